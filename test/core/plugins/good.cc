// A plug-in with one feature type.
#include <plumbline/core/plugin.h>

#include <utility>

PLUMBLINE_PLUGIN(registry) {
  plumbline::FeatureType type;
  type.name = "tree";
  type.g2o_tag = "MINE_TREE";
  type.parameters = {plumbline::Quantity::Length("x"),
                     plumbline::Quantity::Length("y")};
  registry->Register(std::move(type));
}
