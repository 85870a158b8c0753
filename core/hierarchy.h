#ifndef PLUMBLINE_CORE_HIERARCHY_H_
#define PLUMBLINE_CORE_HIERARCHY_H_

#include <plumbline/core/detector.h>
#include <plumbline/core/hierarchy_spec.h>
#include <plumbline/core/registry.h>

#include <map>
#include <memory>
#include <string>
#include <vector>

namespace plumbline {

/// Detectors by the level whose features they read: hierarchy[0] reads level 0.
using Hierarchy = std::vector<std::vector<std::unique_ptr<StructureDetector>>>;

/// Makes the detectors with their parameters (by detector name; what is missing
/// is the default). A level holds what the detectors of the level below make,
/// level 0 holds `raw_feature_types`. Throws Error with the list of detectors
/// when a name is unknown, and with the list of what fits where when a detector
/// reads nothing that its level can hold.
Hierarchy MakeHierarchy(
    const HierarchySpec& spec, const Registry& registry,
    const std::vector<std::string>& raw_feature_types,
    const std::map<std::string, DetectorParameters>& parameters);

}  // namespace plumbline

#endif  // PLUMBLINE_CORE_HIERARCHY_H_
