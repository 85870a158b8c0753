// A plug-in with one feature type.
#include <plumbline/core/plugin.h>

#include <utility>

PLUMBLINE_PLUGIN(registry) {
  plumbline::FeatureType type;
  type.name = "tree";
  type.size = 2;
  type.g2o_tag = "MINE_TREE";
  type.parameter_names = {"x m", "y m"};
  registry->Register(std::move(type));
}
