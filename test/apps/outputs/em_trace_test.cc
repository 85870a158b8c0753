#include <gtest/gtest.h>
#include <plumbline/core/error.h>
#include <plumbline/outputs/em_trace.h>

#include <sstream>

namespace plumbline {
namespace {

TEST(EmTraceTest, OneColumnAFeatureTypeOfAnyRow) {
  EmTraceRow first;
  first.phase.iteration = 0;
  first.phase.phase = "measurements";
  first.phase.cost.measurement = 0.1;
  first.phase.features = {{"segment", 12}, {"pose", 1}};
  first.phase.seconds = 0.25;
  EmTraceRow second;
  second.phase.iteration = 1;
  second.phase.phase = "detect_0";
  second.phase.cost.measurement = 1e-9;
  second.phase.cost.structure = 2.5;
  second.phase.features = {{"segment", 12}, {"orientation", 2}};
  second.phase.structure_constraints = 10;
  second.phase.broken_constraints = 3;
  second.phase.structure_by_relation = {{"segment_orientation", 10}};
  second.phase.broken_by_relation = {{"segment_orientation", 1},
                                     {"segment_segment_collinearity", 2}};
  second.phase.seconds = 2.0;
  second.phase.detections["same_wall"] = {
      {"place pairs", 7}, {"place pairs refused: one visit", 3}};
  second.mean_position_error = 0.0;
  std::ostringstream output;
  WriteEmTrace({first, second}, output);
  EXPECT_EQ(output.str(),
            "iteration,phase,cost_measurement,cost_structure,"
            "features_orientation,features_pose,features_segment,"
            "structure_constraints,broken_constraints,"
            "structure_segment_orientation,broken_segment_orientation,"
            "structure_segment_segment_collinearity,"
            "broken_segment_segment_collinearity,seconds,"
            "mean_position_error,same_wall_place_pairs,"
            "same_wall_place_pairs_refused_one_visit\n"
            "0,measurements,0.1,0,0,1,12,0,0,0,0,0,0,0.25,,,\n"
            "1,detect_0,1e-09,2.5,2,0,12,10,3,10,1,0,2,2,0,7,3\n");
}

TEST(EmTraceTest, WithoutRowsThereIsAHeader) {
  std::ostringstream output;
  WriteEmTrace({}, output);
  EXPECT_EQ(output.str(),
            "iteration,phase,cost_measurement,cost_structure,"
            "structure_constraints,broken_constraints,seconds,"
            "mean_position_error\n");
}

TEST(EmTraceTest, SaysWhenItCannotBeWritten) {
  EXPECT_THROW(WriteEmTrace({}, "/no/such/folder/em_trace.csv"), Error);
}

}  // namespace
}  // namespace plumbline
