#include <gtest/gtest.h>
#include <plumbline/pipeline/guessed_parts.h>

#include <cstddef>
#include <functional>
#include <set>
#include <string>
#include <utility>
#include <vector>

#include "frontend/long_hall.h"

namespace plumbline {
namespace {

using testing::HeadingError;
using testing::LongHall;
using testing::MakeScan;
using testing::PositionError;
using testing::WallEnds;

// A log of key scans, part by part, each of which begins with a guess.
struct GuessedLog {
  std::vector<Scan> scans;
  LogSolverResult result;
  std::vector<Pose2> truth;
  std::vector<Pose2> poses;
  PartTies ties;

  // Drives along the hall at `y` from x to x, with poses that are off by
  // `shift`.
  void Drive(const std::vector<WallEnds>& hall, double from, double to,
             double y, const Pose2& shift) {
    testing::Laser laser = testing::FullCircle();
    laser.angle_step = DegToRad(2.0);
    laser.beams = 180;
    const int first = static_cast<int>(scans.size());
    const double step = to > from ? 0.3 : -0.3;
    const int count = static_cast<int>((to - from) / step);
    for (int k = 0; k < count; ++k) {
      const Pose2 at(from + step * k, y, step > 0.0 ? 0.0 : kPi);
      const int scan = static_cast<int>(scans.size());
      scans.push_back(MakeScan(hall, at, laser));
      truth.push_back(at);
      poses.push_back(Compose(shift, at));
      RefinedScan refined;
      refined.is_key = true;
      KeyScanRecord record;
      record.scan = scan;
      if (k > 0) {
        record.motion.mean = Between(poses[poses.size() - 2], poses.back());
      } else if (first > 0) {
        refined.tie = TrackTie::kLoose;
        record.is_loose = true;
        record.motion.mean = Between(poses[poses.size() - 2], poses.back());
        LooseTrack loose;
        loose.begin = first - 1;
        loose.why = "scans are missing; where it went on is a guess, turned";
        result.loose.push_back(loose);
      }
      result.refined.push_back(refined);
      result.records.push_back(record);
    }
    if (first > 0) result.loose.back().end = static_cast<int>(scans.size()) - 1;
  }

  // Along the hall, and back on another way with poses that are off; returns
  // where the way back begins.
  std::size_t DriveThereAndBack(const Pose2& shift) {
    Drive(LongHall(), -18.0, 18.0, 0.2, Pose2::Zero());
    const std::size_t second = scans.size();
    Drive(LongHall(), 17.0, -17.0, -0.2, shift);
    return second;
  }

  // The part that begins with this scan goes on from what was before.
  void MakeGoOn(std::size_t scan) {
    result.refined[scan].tie = TrackTie::kNone;
    result.records[scan].is_loose = false;
    result.loose.pop_back();
  }

  // The part that begins with this scan was found by a few of its scans, where
  // its poses are.
  void MakeFound(std::size_t scan, std::size_t since) {
    RefinedScan& refined = result.refined[scan];
    refined.tie = TrackTie::kMatched;
    refined.since = static_cast<int>(since);
    KeyScanRecord& record = result.records[scan];
    record.is_loose = false;
    record.from = static_cast<int>(since);
    record.motion.mean = Between(poses[since], poses[scan]);
    for (LooseTrack& loose : result.loose) {
      if (loose.begin + 1 != static_cast<int>(scan)) continue;
      loose.found = true;
      loose.end = static_cast<int>(scan);
      loose.why = "scans are missing; found again on what it saw earlier";
    }
  }

  bool Place(const std::function<bool()>& stop = nullptr) {
    return PlaceUnsureParts(scans, WithinOneBuilding(TrackPlacementOptions()),
                            stop, &result, &poses, &ties);
  }

  void TellOfDoubts() {
    TellOfDoubtfulParts(scans, WithinOneBuilding(TrackPlacementOptions()),
                        nullptr, &result, poses, ties);
  }

  // All of it is where it was, and one part is told as found: `how` it was
  // tied before.
  void ExpectFound(const std::string& how) const {
    ExpectTrue(0, poses.size());
    EXPECT_FALSE(HasUnsureParts(scans, result, ties.sure));
    ASSERT_EQ(result.loose.size(), 1u);
    EXPECT_TRUE(result.loose[0].found);
    EXPECT_EQ(result.loose[0].why,
              how + "; found again by all that it saw afterwards");
  }

  // The scan is no key scan: the next one is.
  void TakeKeyFrom(std::size_t scan) {
    const auto at = static_cast<std::ptrdiff_t>(scan);
    result.refined[scan].is_key = false;
    result.records.erase(result.records.begin() + at);
    poses.erase(poses.begin() + at);
    truth.erase(truth.begin() + at);
    result.records[scan].motion.mean = Between(poses[scan - 1], poses[scan]);
  }

  void ExpectTrue(std::size_t begin, std::size_t end) const {
    for (std::size_t k = begin; k < end; ++k) {
      EXPECT_LT(PositionError(poses[k], truth[k]), 0.1) << k;
      EXPECT_LT(HeadingError(poses[k], truth[k]), DegToRad(0.5)) << k;
    }
  }
};

const Pose2 kLost(60.0, -30.0, 2.2);

std::vector<WallEnds> MirroredHall() {
  std::vector<WallEnds> mirrored = LongHall();
  for (WallEnds& wall : mirrored) {
    wall.a.y() *= -1.0;
    wall.b.y() *= -1.0;
  }
  return mirrored;
}

// The robot was carried and sees the hall once more, on another way.
TEST(GuessedPartsTest, APartIsFoundWhereMostSawIt) {
  GuessedLog log;
  const std::size_t second = log.DriveThereAndBack(kLost);
  ASSERT_TRUE(HasUnsureParts(log.scans, log.result, log.ties.sure));
  ASSERT_TRUE(log.Place());
  log.ExpectTrue(0, log.scans.size());
  EXPECT_EQ(log.poses.front(), log.truth.front());
  const KeyScanRecord& tied = log.result.records[second];
  EXPECT_FALSE(tied.is_loose);
  EXPECT_EQ(tied.from, static_cast<int>(second) - 1);
  const Pose2 way = Between(log.truth[second - 1], log.truth[second]);
  EXPECT_LT(PositionError(tied.motion.mean, way), 0.1);
  EXPECT_GT(tied.motion.covariance(0, 0), 0.01 - 1e-9);
  EXPECT_EQ(log.result.refined[second].tie, TrackTie::kMatched);
  EXPECT_EQ(log.result.refined[second].since, static_cast<int>(second) - 1);
  ASSERT_EQ(log.result.loose.size(), 1u);
  EXPECT_TRUE(log.result.loose[0].found);
  EXPECT_EQ(log.result.loose[0].end, static_cast<int>(second));
  EXPECT_EQ(log.result.loose[0].why,
            "scans are missing; found again by all that it saw afterwards");
  EXPECT_FALSE(HasUnsureParts(log.scans, log.result, log.ties.sure));
}

// The larger part comes second: the map's frame is that of the first scan all
// the same.
TEST(GuessedPartsTest, TheFirstScanStays) {
  GuessedLog log;
  log.Drive(LongHall(), -17.5, 15.0, 0.3, Pose2::Zero());
  const std::size_t second = log.scans.size();
  log.Drive(LongHall(), 18.0, -18.0, -0.1, kLost);
  ASSERT_TRUE(log.Place());
  log.ExpectTrue(0, log.scans.size());
  EXPECT_LT(PositionError(log.poses.front(), log.truth.front()), 1e-9);
  EXPECT_LT(HeadingError(log.poses.front(), log.truth.front()), 1e-9);
  EXPECT_EQ(log.result.records[second].from, static_cast<int>(second) - 1);
}

// A few scans look like those of another place; all of them do not.
TEST(GuessedPartsTest, APartThatWasFoundAtAWrongPlaceIsMoved) {
  GuessedLog log;
  const std::size_t second = log.DriveThereAndBack(Pose2(8.0, 0.1, 0.0));
  log.MakeFound(second, 40);
  ASSERT_TRUE(HasUnsureParts(log.scans, log.result, log.ties.sure));
  ASSERT_TRUE(log.Place());
  log.ExpectTrue(0, log.scans.size());
  EXPECT_EQ(log.result.loose[0].why,
            "scans are missing; found again by all that it saw afterwards");
  EXPECT_TRUE(log.result.loose[0].found);
  EXPECT_FALSE(HasUnsureParts(log.scans, log.result, log.ties.sure));
}

TEST(GuessedPartsTest, APartThatWasFoundAtItsPlaceStays) {
  GuessedLog log;
  const std::size_t second =
      log.DriveThereAndBack(Pose2(0.3, 0.1, DegToRad(1.0)));
  log.MakeFound(second, 40);
  const std::vector<Pose2> before = log.poses;
  EXPECT_FALSE(log.Place());
  EXPECT_EQ(log.poses, before);
  EXPECT_EQ(log.result.records[second].from, 40);
  EXPECT_EQ(log.ties.sure, std::set<int>{static_cast<int>(second)});
  EXPECT_TRUE(log.result.loose[0].found);
  EXPECT_EQ(log.result.loose[0].why,
            "scans are missing; found again on what it saw earlier");
}

// Of what was found near by nothing was told; what was not there is.
TEST(GuessedPartsTest, APartThatWasFoundNearByIsHeldAgainstTheRest) {
  for (const bool is_right : {false, true}) {
    SCOPED_TRACE(is_right);
    GuessedLog log;
    const std::size_t second = log.DriveThereAndBack(
        is_right ? Pose2(0.2, 0.0, 0.0) : Pose2(4.0, 0.1, 0.0));
    log.MakeFound(second, second - 1);
    log.result.records[second].from = -1;
    log.result.refined[second].since = -1;
    log.result.refined[second].missed = Pose2(1.0, 0.0, 0.0);
    log.result.refined[second].missed_since = 7;
    log.result.loose.clear();
    EXPECT_EQ(log.Place(), !is_right);
    EXPECT_FALSE(HasUnsureParts(log.scans, log.result, log.ties.sure));
    if (is_right) {
      EXPECT_TRUE(log.result.loose.empty());
      EXPECT_EQ(log.result.refined[second].missed_since, 7);
      continue;
    }
    log.ExpectTrue(0, log.scans.size());
    EXPECT_EQ(log.result.refined[second].missed_since, -1);
    ASSERT_EQ(log.result.loose.size(), 1u);
    const LooseTrack& loose = log.result.loose[0];
    EXPECT_TRUE(loose.found);
    EXPECT_EQ(loose.begin, static_cast<int>(second) - 1);
    EXPECT_EQ(loose.end, static_cast<int>(second));
    EXPECT_EQ(loose.why,
              "the next scan does not fit; found again by all that it saw "
              "afterwards");
  }
}

// After scans that are missing the next one may seem to follow, in a corridor
// that looks like this one.
TEST(GuessedPartsTest, WhatSeemsToGoOnAfterALongGapIsHeldAgainstTheRest) {
  for (const bool is_long : {false, true}) {
    SCOPED_TRACE(is_long);
    GuessedLog log;
    const std::size_t second = log.DriveThereAndBack(Pose2(4.0, 0.1, 0.0));
    log.MakeGoOn(second);
    for (std::size_t k = 0; k < log.scans.size(); ++k) {
      log.scans[k].timestamp =
          0.2 * static_cast<double>(k) + (is_long && k >= second ? 60.0 : 0.0);
    }
    EXPECT_EQ(HasUnsureParts(log.scans, log.result, log.ties.sure), is_long);
    EXPECT_EQ(log.Place(), is_long);
    if (!is_long) continue;
    log.ExpectFound("scans are missing");
    EXPECT_EQ(log.result.refined[second].tie, TrackTie::kMatched);
  }
}

// Where nothing could be matched for a while the first match may be of another
// place, which only what odometry missed by then tells.
TEST(GuessedPartsTest, WhatOdometryMissedIsHeldAgainstTheRest) {
  struct Case {
    Pose2 missed;
    bool is_since_matched;
    bool is_of_key;
    bool is_held;
  };
  const Pose2 far(0.4, -0.4, 0.0);
  for (const Case& c :
       {Case{far, true, true, true}, Case{far, true, false, true},
        Case{Pose2(0.0, 0.0, -0.2), true, true, true},
        Case{Pose2(0.3, 0.3, 0.15), true, true, false},
        Case{far, false, true, false}}) {
    SCOPED_TRACE(::testing::Message() << c.missed.transpose() << ' '
                                      << c.is_since_matched << c.is_of_key);
    GuessedLog log;
    const std::size_t second = log.DriveThereAndBack(Pose2(4.0, 0.1, 0.0));
    log.MakeGoOn(second);
    RefinedScan& scan = log.result.refined[second];
    scan.missed_since = c.is_since_matched ? static_cast<int>(second) - 1 : -1;
    scan.missed = c.missed;
    if (!c.is_of_key) log.TakeKeyFrom(second);
    EXPECT_EQ(HasUnsureParts(log.scans, log.result, log.ties.sure), c.is_held);
    const std::vector<Pose2> before = log.poses;
    EXPECT_EQ(log.Place(), c.is_held);
    if (c.is_held) {
      log.ExpectFound("odometry alone says where the robot went");
    } else {
      EXPECT_EQ(log.poses, before);
      EXPECT_TRUE(log.result.loose.empty());
    }
  }
}

// It is nowhere else, but not there either, and that is told.
TEST(GuessedPartsTest, WhatContradictsItsPlaceIsTold) {
  const std::vector<WallEnds> mirrored = MirroredHall();
  GuessedLog log;
  log.Drive(LongHall(), -18.0, 18.0, 0.2, Pose2::Zero());
  const std::size_t second = log.scans.size();
  log.Drive(mirrored, 17.0, -17.0, -0.2, Pose2::Zero());
  log.MakeFound(second, 40);
  const std::vector<Pose2> before = log.poses;
  EXPECT_FALSE(log.Place());
  log.TellOfDoubts();
  EXPECT_EQ(log.poses, before);
  ASSERT_EQ(log.result.loose.size(), 1u);
  EXPECT_FALSE(log.result.loose[0].found);
  EXPECT_EQ(log.result.loose[0].end, static_cast<int>(log.scans.size()) - 1);
  EXPECT_EQ(log.result.loose[0].why,
            "scans are missing; found again on what it saw earlier, where most "
            "of what it saw afterwards contradicts that");
}

// Most of it agrees, and more contradicts than of a place that is found: it is
// nowhere else, and that is told.
TEST(GuessedPartsTest, WhatIsContestedIsTold) {
  for (const bool is_contested : {false, true}) {
    SCOPED_TRACE(is_contested);
    GuessedLog log;
    log.Drive(LongHall(), -18.0, 18.0, 0.2, Pose2::Zero());
    const std::size_t second = log.scans.size();
    log.Drive(LongHall(), 17.0, -3.0, -0.2, Pose2::Zero());
    log.MakeFound(second, 40);
    const std::size_t third = log.scans.size();
    log.Drive(is_contested ? MirroredHall() : LongHall(), -3.0, -17.0, -0.2,
              Pose2::Zero());
    log.MakeGoOn(third);
    const std::vector<Pose2> before = log.poses;
    EXPECT_FALSE(log.Place());
    EXPECT_EQ(log.ties.sure.empty(), is_contested);
    log.TellOfDoubts();
    EXPECT_EQ(log.poses, before);
    ASSERT_EQ(log.result.loose.size(), 1u);
    EXPECT_TRUE(log.result.loose[0].found);
    EXPECT_EQ(log.result.loose[0].is_ambiguous, is_contested);
    EXPECT_EQ(
        log.result.loose[0].why,
        std::string("scans are missing; found again on what it saw "
                    "earlier") +
            (is_contested
                 ? ", which what it saw afterwards does not make certain: "
                   "4 short stretches of it agree with what was seen "
                   "there, 3 contradict it"
                 : ""));
  }
}

// Nothing speaks against its place, nor against another one where the robot saw
// the same hall once more.
TEST(GuessedPartsTest, WhatFitsElsewhereTooIsTold) {
  for (const bool has_twin : {false, true}) {
    SCOPED_TRACE(has_twin);
    GuessedLog log;
    log.Drive(LongHall(), -18.0, 18.0, 0.2, Pose2::Zero());
    if (has_twin) {
      const std::size_t twin = log.scans.size();
      log.Drive(LongHall(), -18.0, 18.0, 0.2, Pose2(0.0, 30.0, 0.0));
      log.MakeGoOn(twin);
    }
    const std::size_t last = log.scans.size();
    log.Drive(LongHall(), 17.0, -17.0, -0.2, Pose2::Zero());
    log.MakeFound(last, 40);
    log.result.loose.clear();
    EXPECT_FALSE(log.Place());
    log.TellOfDoubts();
    ASSERT_EQ(log.result.loose.size(), has_twin ? 1u : 0u);
    if (!has_twin) continue;
    const LooseTrack& loose = log.result.loose[0];
    EXPECT_TRUE(loose.found);
    EXPECT_TRUE(loose.is_ambiguous);
    EXPECT_EQ(loose.begin, static_cast<int>(last) - 1);
    EXPECT_EQ(loose.end, static_cast<int>(last));
    EXPECT_EQ(loose.why,
              "the next scan does not fit; found again near by, which what it "
              "saw afterwards does not make certain: it would fit in more than "
              "one place");
  }
}

// What could be said of a place that was not known yet, as that corridors look
// alike, is not told of one that all agrees with.
TEST(GuessedPartsTest, WhatFitsNowhereElseIsNotTold) {
  GuessedLog log;
  const std::size_t second = log.DriveThereAndBack(Pose2::Zero());
  log.MakeFound(second, 40);
  log.result.loose.clear();
  TrackPlacementOptions options = WithinOneBuilding(TrackPlacementOptions());
  options.min_certain_information_share = 1.1;
  EXPECT_FALSE(PlaceUnsureParts(log.scans, options, nullptr, &log.result,
                                &log.poses, &log.ties));
  EXPECT_TRUE(log.ties.doubts.empty());
  TellOfDoubtfulParts(log.scans, options, nullptr, &log.result, log.poses,
                      log.ties);
  EXPECT_TRUE(log.result.loose.empty());
}

// The long hall with openings of 1.2 m in the wall above, at these x; behind
// them is another wall.
std::vector<WallEnds> HallWithDoors(const std::vector<double>& doors) {
  std::vector<WallEnds> walls;
  for (const WallEnds& wall : LongHall()) {
    const bool is_above = wall.a.y() == 3.0 && wall.b.y() == 3.0;
    if (!is_above) walls.push_back(wall);
  }
  double begin = -20.0;
  for (const double door : doors) {
    walls.push_back({{begin, 3.0}, {door - 0.6, 3.0}});
    begin = door + 0.6;
  }
  walls.push_back({{begin, 3.0}, {20.0, 3.0}});
  walls.push_back({{-20.0, 5.5}, {20.0, 5.5}});
  return walls;
}

// People shut a door and open another one, and the walls are the same on the
// next floor.
TEST(GuessedPartsTest, DoorsThatStandElsewhereAreTold) {
  const std::vector<double> before = {-9.0, 3.0};
  const std::vector<std::vector<double>> afterwards = {
      before, {-9.0, 3.0, 9.0}, {-7.0, 3.0}, {-7.0, 5.0}};
  const std::vector<std::string> told = {
      "", "", "1 door stands elsewhere in the same wall, as on another floor",
      "2 doors stand elsewhere in the same wall, as on another floor"};
  for (std::size_t i = 0; i < afterwards.size(); ++i) {
    SCOPED_TRACE(i);
    GuessedLog log;
    log.Drive(HallWithDoors(before), -18.0, 18.0, 0.2, Pose2::Zero());
    const std::size_t second = log.scans.size();
    log.Drive(HallWithDoors(afterwards[i]), 17.0, -17.0, -0.2, Pose2::Zero());
    log.MakeFound(second, second - 1);
    log.result.loose.clear();
    log.Place();
    EXPECT_FALSE(HasUnsureParts(log.scans, log.result, log.ties.sure));
    log.TellOfDoubts();
    if (told[i].empty()) {
      EXPECT_TRUE(log.result.loose.empty());
      continue;
    }
    ASSERT_EQ(log.result.loose.size(), 1u);
    EXPECT_EQ(log.result.loose[0].why,
              "the next scan does not fit; found again near by, which what it "
              "saw afterwards does not make certain: " +
                  told[i]);
    EXPECT_TRUE(log.result.loose[0].found);
    EXPECT_TRUE(log.result.loose[0].is_ambiguous);
  }
}

// A third of it would fit in another place, too: it stays where it was found,
// as sure as can be, and that is told. Where it was not found before it is put
// there as a guess.
TEST(GuessedPartsTest, ALikelyPlaceWhereItWasFoundBeforeHolds) {
  for (const bool was_found : {true, false}) {
    SCOPED_TRACE(was_found);
    GuessedLog log;
    log.Drive(LongHall(), -18.0, 18.0, 0.2, Pose2::Zero());
    const std::size_t twin = log.scans.size();
    log.Drive(LongHall(), -18.0, -7.0, 0.2, Pose2(0.0, 30.0, 0.0));
    log.MakeGoOn(twin);
    const Pose2 shift = was_found ? Pose2(0.3, 0.1, 0.0) : kLost;
    const std::size_t few = log.scans.size();
    log.Drive(LongHall(), 17.0, 14.0, -0.2, shift);
    if (was_found) log.MakeFound(few, 40);
    const std::size_t last = log.scans.size();
    log.Drive(LongHall(), 14.0, -17.0, -0.2, shift);
    log.MakeFound(last, last - 1);
    log.result.loose.clear();
    EXPECT_TRUE(log.Place());
    EXPECT_EQ(log.ties.sure.count(static_cast<int>(last)), was_found ? 1u : 0u);
    log.ExpectTrue(last, log.scans.size());
    if (!was_found) {
      ASSERT_EQ(log.result.loose.size(), 1u);
      EXPECT_FALSE(log.result.loose[0].found);
      EXPECT_NE(log.result.loose[0].why.find("is a guess, on "),
                std::string::npos)
          << log.result.loose[0].why;
      continue;
    }
    log.TellOfDoubts();
    ASSERT_EQ(log.result.loose.size(), 1u);
    EXPECT_TRUE(log.result.loose[0].is_ambiguous);
    EXPECT_EQ(log.result.loose[0].why,
              "the next scan does not fit; found again by all that it saw "
              "afterwards, which what it saw afterwards does not make certain: "
              "much of it would fit in another place, too");
  }
}

// What was found by most of it was adjusted, and some of it is elsewhere then.
TEST(GuessedPartsTest, WhatStillContradictsIsTold) {
  for (const bool is_bent : {false, true}) {
    SCOPED_TRACE(is_bent);
    GuessedLog log;
    log.DriveThereAndBack(kLost);
    ASSERT_TRUE(log.Place());
    if (is_bent) {
      for (std::size_t k = log.scans.size() - 50; k < log.scans.size(); ++k) {
        log.poses[k] = Compose(Pose2(2.0, 1.5, 0.0), log.poses[k]);
      }
    }
    log.TellOfDoubts();
    ASSERT_EQ(log.result.loose.size(), 1u);
    EXPECT_EQ(log.result.loose[0].is_ambiguous, is_bent);
    EXPECT_EQ(
        log.result.loose[0].why.find(" contradict it") != std::string::npos,
        is_bent)
        << log.result.loose[0].why;
  }
}

// A robot that was carried sees a few metres of the hall, and then what it had
// not seen: where it may be, still told as a guess.
// However far the rest lies from there.
TEST(GuessedPartsTest, AGuessIsPutWhereALittleOfItFits) {
  for (const auto& [is_hall, distance] :
       {std::pair<bool, double>(true, 50.0), {true, 200.0}, {false, 50.0}}) {
    SCOPED_TRACE(::testing::Message() << is_hall << ' ' << distance);
    GuessedLog log;
    log.Drive(LongHall(), -18.0, 18.0, 0.2, Pose2::Zero());
    const std::size_t second = log.scans.size();
    log.Drive(is_hall ? LongHall() : MirroredHall(), 17.0, 1.0, -0.2, kLost);
    const std::size_t beyond = log.scans.size();
    const std::vector<WallEnds> room = {{{-20.0, -9.0}, {20.0, -9.0}},
                                        {{20.0, -9.0}, {20.0, 11.0}},
                                        {{20.0, 11.0}, {-20.0, 11.0}},
                                        {{-20.0, 11.0}, {-20.0, -9.0}}};
    log.Drive(room, -17.0, 17.0, 0.1,
              Compose(kLost, Pose2(distance, 0.0, 0.0)));
    log.MakeGoOn(beyond);
    log.result.loose.back().end = static_cast<int>(log.scans.size()) - 1;
    const std::vector<Pose2> before = log.poses;
    EXPECT_EQ(log.Place(), is_hall);
    ASSERT_EQ(log.result.loose.size(), 1u);
    const LooseTrack& loose = log.result.loose[0];
    EXPECT_FALSE(loose.found);
    EXPECT_EQ(loose.end, static_cast<int>(log.scans.size()) - 1);
    if (!is_hall) {
      EXPECT_EQ(log.poses, before);
      continue;
    }
    log.ExpectTrue(0, beyond);
    EXPECT_EQ(log.result.refined[second].tie, TrackTie::kMatched);
    EXPECT_TRUE(HasUnsureParts(log.scans, log.result, log.ties.sure));
    EXPECT_EQ(loose.why.substr(0, 50),
              "scans are missing; where it went on is a guess, on");
  }
}

// A few scans of it look like those of 9 m farther on, and the others
// contradict that: it is put where a little of it fits, as a guess. Where
// nothing speaks against its place a little does not move it.
TEST(GuessedPartsTest, WhatIsRefutedIsPutWhereALittleOfItFits) {
  for (const bool is_refuted : {true, false}) {
    SCOPED_TRACE(is_refuted);
    GuessedLog log;
    log.Drive(LongHall(), -18.0, 18.0, 0.2, Pose2::Zero());
    const std::size_t second = log.scans.size();
    const Pose2 shift = is_refuted ? Pose2(-9.0, 0.0, 0.0) : kLost;
    log.Drive(LongHall(), 17.0, -4.0, -0.2, shift);
    log.MakeFound(second, 40);
    const std::size_t beyond = log.scans.size();
    const std::vector<WallEnds> room = {{{-20.0, -9.0}, {20.0, -9.0}},
                                        {{20.0, -9.0}, {20.0, 11.0}},
                                        {{20.0, 11.0}, {-20.0, 11.0}},
                                        {{-20.0, 11.0}, {-20.0, -9.0}}};
    log.Drive(room, -17.0, -4.0, 0.1, Compose(shift, Pose2(60.0, 0.0, 0.0)));
    log.MakeGoOn(beyond);
    const std::vector<Pose2> before = log.poses;
    EXPECT_EQ(log.Place(), is_refuted);
    ASSERT_EQ(log.result.loose.size(), 1u);
    const LooseTrack& loose = log.result.loose[0];
    EXPECT_EQ(loose.found, !is_refuted);
    if (!is_refuted) {
      EXPECT_EQ(log.poses, before);
      continue;
    }
    log.ExpectTrue(0, beyond);
    EXPECT_TRUE(HasUnsureParts(log.scans, log.result, log.ties.sure));
    EXPECT_EQ(loose.why.substr(0, 50),
              "scans are missing; where it went on is a guess, on");
    EXPECT_EQ(loose.end, static_cast<int>(log.scans.size()) - 1);
  }
}

// Where it was found more contradicts than a half of what agrees, and a few
// windows agree where little was seen, which nothing contradicts: it is put
// there, as a guess. Where all agrees it stays.
TEST(GuessedPartsTest, WhatIsOutweighedIsPutWhereNothingContradicts) {
  for (const bool is_outweighed : {true, false}) {
    SCOPED_TRACE(is_outweighed);
    GuessedLog log;
    log.Drive(LongHall(), -18.0, -8.0, 0.2, Pose2::Zero());
    // Another hall, of which the one half is the same.
    const Pose2 other(100.0, 0.0, 0.0);
    const std::size_t same = log.scans.size();
    log.Drive(LongHall(), 18.0, -1.5, 0.2, other);
    log.MakeGoOn(same);
    const std::size_t rest = log.scans.size();
    log.Drive(is_outweighed ? MirroredHall() : LongHall(), -1.5, -18.0, 0.2,
              other);
    log.MakeGoOn(rest);
    const std::size_t second = log.scans.size();
    log.Drive(LongHall(), 17.0, -17.0, -0.2, other);
    log.MakeFound(second, 40);
    const std::vector<Pose2> before = log.poses;
    EXPECT_EQ(log.Place(), is_outweighed);
    ASSERT_EQ(log.result.loose.size(), 1u);
    EXPECT_EQ(log.result.loose[0].found, !is_outweighed);
    if (!is_outweighed) {
      EXPECT_EQ(log.poses, before);
      continue;
    }
    log.ExpectTrue(second, log.scans.size());
    EXPECT_EQ(log.result.loose[0].why.substr(0, 50),
              "scans are missing; where it went on is a guess, on");
    EXPECT_EQ(log.result.loose[0].end, static_cast<int>(log.scans.size()) - 1);
  }
}

// A few metres are put where all of them fit, and where they would fit in no
// other place; still told as a guess. The first scan stays, whose part it is.
TEST(GuessedPartsTest, AShortGuessIsPutWhereAllOfItFits) {
  enum Case { kLast, kFirst, kTwice, kNowhere };
  for (const Case which : {kLast, kFirst, kTwice, kNowhere}) {
    SCOPED_TRACE(which);
    GuessedLog log;
    const std::vector<WallEnds> hall =
        which == kNowhere ? MirroredHall() : LongHall();
    if (which == kFirst) {
      log.Drive(hall, 17.0, 11.0, -0.2, Pose2::Zero());
      log.Drive(LongHall(), -18.0, 18.0, 0.2, kLost);
    } else {
      log.Drive(LongHall(), -18.0, 18.0, 0.2, Pose2::Zero());
      const std::size_t twin = log.scans.size();
      if (which == kTwice) {
        log.Drive(LongHall(), -18.0, 18.0, 0.2, Pose2(0.0, 30.0, 0.0));
        log.MakeGoOn(twin);
      }
      log.Drive(hall, 17.0, 11.0, -0.2, kLost);
    }
    const std::vector<Pose2> before = log.poses;
    const bool is_put = which == kLast || which == kFirst;
    EXPECT_EQ(log.Place(), is_put);
    ASSERT_EQ(log.result.loose.size(), 1u);
    EXPECT_FALSE(log.result.loose[0].found);
    if (!is_put) {
      EXPECT_EQ(log.poses, before);
      continue;
    }
    log.ExpectTrue(0, log.scans.size());
    EXPECT_LT(PositionError(log.poses.front(), log.truth.front()), 1e-9);
    EXPECT_TRUE(HasUnsureParts(log.scans, log.result, log.ties.sure));
    EXPECT_EQ(log.result.loose[0].why,
              "scans are missing; where it went on is a guess, on 2 short "
              "stretches of what it saw afterwards");
  }
}

// Two parts show too little of the hall each, and another one together: found
// in each other they are found in the hall, and where they were not in it they
// lie right to each other all the same.
TEST(GuessedPartsTest, PartsThatAreFoundInEachOtherGoTogether) {
  std::vector<WallEnds> beyond = MirroredHall();
  for (WallEnds& wall : beyond) {
    wall.a.x() += 50.0;
    wall.b.x() += 50.0;
  }
  for (const bool are_in_hall : {true, false}) {
    SCOPED_TRACE(are_in_hall);
    GuessedLog log;
    log.Drive(LongHall(), -18.0, 18.0, 0.2, Pose2::Zero());
    if (!are_in_hall) {
      // The largest part, on which the others hang.
      const std::size_t back = log.scans.size();
      log.Drive(LongHall(), 18.0, -18.0, -0.2, Pose2::Zero());
      log.MakeGoOn(back);
    }
    const Pose2 lost_again(-40.0, 70.0, -1.1);
    const std::size_t second = log.scans.size();
    if (are_in_hall) log.Drive(LongHall(), 17.0, 1.0, -0.2, kLost);
    const std::size_t second_beyond = log.scans.size();
    log.Drive(beyond, 33.0, 67.0, 0.1, kLost);
    if (are_in_hall) log.MakeGoOn(second_beyond);
    log.result.loose.back().end = static_cast<int>(log.scans.size()) - 1;
    const std::size_t third = log.scans.size();
    if (are_in_hall) log.Drive(LongHall(), -17.0, -1.0, 0.1, lost_again);
    const std::size_t third_beyond = log.scans.size();
    log.Drive(beyond, 67.0, 33.0, -0.2, lost_again);
    if (are_in_hall) log.MakeGoOn(third_beyond);
    log.result.loose.back().end = static_cast<int>(log.scans.size()) - 1;
    const std::vector<Pose2> before = log.poses;
    ASSERT_TRUE(log.Place());
    EXPECT_EQ(log.result.records[third].is_loose, false);
    EXPECT_EQ(log.result.records[second].is_loose, !are_in_hall);
    ASSERT_EQ(log.result.loose.size(), 2u);
    EXPECT_TRUE(log.result.loose[1].found);
    log.TellOfDoubts();
    EXPECT_EQ(log.result.loose[1].is_ambiguous, !are_in_hall);
    EXPECT_EQ(
        log.result.loose[1].why.find("by a guess itself") != std::string::npos,
        !are_in_hall)
        << log.result.loose[1].why;
    if (are_in_hall) {
      log.ExpectTrue(0, log.scans.size());
      continue;
    }
    EXPECT_FALSE(log.result.loose[0].found);
    for (std::size_t k = second; k < third; ++k) {
      EXPECT_EQ(log.poses[k], before[k]);
    }
    for (std::size_t k = third; k < log.scans.size(); ++k) {
      const Pose2 right = Compose(kLost, log.truth[k]);
      EXPECT_LT(PositionError(log.poses[k], right), 0.1) << k;
      EXPECT_LT(HeadingError(log.poses[k], right), DegToRad(0.5)) << k;
    }
  }
}

// What was found in a part, and is too short to be looked for, goes along with
// it; so does the first part where it is the short one.
TEST(GuessedPartsTest, WhatWasFoundInAPartGoesAlong) {
  GuessedLog log;
  const std::size_t second = log.DriveThereAndBack(Pose2(8.0, 0.1, 0.0));
  log.MakeFound(second, 40);
  const std::size_t third = log.scans.size();
  log.Drive(LongHall(), -17.0, -14.0, 0.0, Pose2(8.0, 0.1, 0.0));
  log.MakeFound(third, third - 5);
  ASSERT_TRUE(log.Place());
  log.ExpectTrue(0, log.scans.size());
  EXPECT_EQ(log.result.records[third].from, static_cast<int>(third) - 5);

  GuessedLog begun;
  begun.Drive(LongHall(), -17.0, -14.0, 0.0, Pose2::Zero());
  const std::size_t long_one = begun.scans.size();
  begun.Drive(LongHall(), -18.0, 18.0, 0.2, Pose2::Zero());
  begun.MakeFound(long_one, 3);
  const std::size_t last = begun.scans.size();
  begun.Drive(LongHall(), 17.0, -17.0, -0.2, Pose2(8.0, 0.1, 0.0));
  begun.MakeFound(last, 40);
  ASSERT_TRUE(begun.Place());
  begun.ExpectTrue(0, begun.scans.size());
}

// What is too short to be looked for stays where it hangs.
TEST(GuessedPartsTest, WhatHangsOnAPartGoesAlong) {
  GuessedLog log;
  log.Drive(LongHall(), -18.0, 18.0, 0.2, Pose2::Zero());
  log.Drive(LongHall(), 17.0, -17.0, -0.2, kLost);
  const std::size_t third = log.scans.size();
  log.Drive(LongHall(), -17.0, -14.0, 0.0, kLost);
  ASSERT_TRUE(log.Place());
  log.ExpectTrue(0, log.scans.size());
  EXPECT_EQ(log.result.refined[third].tie, TrackTie::kLoose);
  EXPECT_TRUE(log.result.records[third].is_loose);
  ASSERT_EQ(log.result.loose.size(), 2u);
  EXPECT_TRUE(log.result.loose[0].found);
  EXPECT_FALSE(log.result.loose[1].found);
}

// And what a part hangs on goes along with it, if that is found nowhere itself.
TEST(GuessedPartsTest, WhatAPartHangsOnGoesAlong) {
  GuessedLog log;
  log.Drive(LongHall(), -17.0, -14.0, 0.0, Pose2::Zero());
  log.Drive(LongHall(), 17.0, -16.0, -0.2, Pose2::Zero());
  log.Drive(LongHall(), -18.0, 18.0, 0.2, kLost);
  ASSERT_TRUE(log.Place());
  log.ExpectTrue(0, log.scans.size());
}

// Nothing is found in a hall that looks the same in a mirror, nor where nothing
// is looked for.
TEST(GuessedPartsTest, AnotherHallIsNotFound) {
  const std::vector<WallEnds> mirrored = MirroredHall();
  for (const bool is_stopped : {false, true}) {
    GuessedLog log;
    log.Drive(LongHall(), -18.0, 18.0, 0.2, Pose2::Zero());
    log.Drive(is_stopped ? LongHall() : mirrored, 17.0, -17.0, -0.2, kLost);
    const std::vector<Pose2> before = log.poses;
    EXPECT_FALSE(log.Place([&] { return is_stopped; }));
    EXPECT_EQ(log.poses, before);
    EXPECT_TRUE(HasUnsureParts(log.scans, log.result, log.ties.sure));
    EXPECT_FALSE(log.result.loose[0].found);
  }
}

TEST(GuessedPartsTest, ALogWithoutGuessesIsLeftAlone) {
  GuessedLog log;
  log.Drive(LongHall(), -18.0, -10.0, 0.2, Pose2::Zero());
  EXPECT_FALSE(HasUnsureParts(log.scans, log.result, log.ties.sure));
  EXPECT_FALSE(log.Place());
  EXPECT_FALSE(GuessedLog().Place());
}

}  // namespace
}  // namespace plumbline
