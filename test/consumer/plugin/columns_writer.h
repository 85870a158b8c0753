#ifndef MINE_COLUMNS_WRITER_H_
#define MINE_COLUMNS_WRITER_H_

#include <plumbline/core/atomic_file.h>
#include <plumbline/core/graph.h>
#include <plumbline/core/registry.h>
#include <plumbline/frontend/output_writer.h>

#include <filesystem>
#include <ostream>
#include <string>

namespace mine {

//! [writer]
/// columns.csv: centre and radius of every circle of the map, m.
inline plumbline::OutputWriterType ColumnsWriterType() {
  plumbline::OutputWriterType type;
  type.name = "columns.csv";
  type.description = "centre and radius of every circle";
  type.write = [](const plumbline::SolvedRun& run,
                  const std::filesystem::path& folder) {
    plumbline::WriteFileAtomically(
        folder / "columns.csv", [&](std::ostream& output) {
          output << "x_m,y_m,radius_m\n";
          for (const plumbline::Feature* feature : run.graph->Features()) {
            if (!feature->type->Is(plumbline::FeatureRole::kCircle)) continue;
            const auto& circle = feature->parameters;
            output << circle[0] << ',' << circle[1] << ',' << circle[2] << '\n';
          }
        });
    return std::string();
  };
  return type;
}
//! [writer]

}  // namespace mine

#endif  // MINE_COLUMNS_WRITER_H_
