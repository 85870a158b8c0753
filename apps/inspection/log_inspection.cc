#include <plumbline/apps/inspection/log_inspection.h>
#include <plumbline/core/error.h>
#include <plumbline/core/utf8.h>
#include <plumbline/factors/pose2.h>
#include <plumbline/frontend/carmen_reader.h>
#include <plumbline/frontend/input_stream.h>
#include <plumbline/frontend/scan.h>

#include <algorithm>
#include <cmath>
#include <cstdarg>
#include <cstdint>
#include <cstdio>
#include <filesystem>
#include <nlohmann/json.hpp>
#include <optional>
#include <string_view>
#include <system_error>
#include <utility>
#include <vector>

namespace plumbline {
namespace {

using Json = nlohmann::ordered_json;

constexpr char kGraphFormat[] = "graph (g2o)";

// A rate from a number of messages and the time they took.
std::optional<double> RateOf(std::int64_t messages, double seconds) {
  if (messages < 2 || !(seconds > 0.0)) return std::nullopt;
  return static_cast<double>(messages - 1) / seconds;
}

Json ToJson(const std::optional<double>& value) {
  return value ? Json(*value) : Json();
}

// What the log is made of.
Json TopicsOf(const std::vector<LogTopic>& topics) {
  Json list = Json::array();
  for (const LogTopic& topic : topics) {
    Json entry = {{"name", topic.name},
                  {"type", topic.type},
                  {"messages", topic.messages}};
    if (topic.messages > 0 && topic.last_time > 0.0) {
      entry["begin_s"] = topic.first_time;
      entry["end_s"] = topic.last_time;
      entry["rate_hz"] =
          ToJson(RateOf(topic.messages, topic.last_time - topic.first_time));
      entry["longest_gap_s"] = topic.largest_gap;
      entry["time_reversals"] = topic.time_reversals;
    }
    entry["use"] = topic.use;
    if (!topic.why_not.empty()) entry["why_not"] = topic.why_not;
    list.push_back(std::move(entry));
  }
  return list;
}

Json ScansOf(const Log& log) {
  const Scan& first = log.scans.front();
  const Scan& last = log.scans.back();
  double gap = 0.0;
  std::int64_t readings = 0;
  std::int64_t returns = 0;
  double nearest = 0.0;
  double farthest = 0.0;
  for (std::size_t i = 0; i < log.scans.size(); ++i) {
    const Scan& scan = log.scans[i];
    if (i > 0) {
      gap = std::max(gap, scan.timestamp - log.scans[i - 1].timestamp);
    }
    for (const float range : scan.ranges) {
      ++readings;
      if (!(range > 0.0f)) continue;
      ++returns;
      const double value = range;
      nearest = returns == 1 ? value : std::min(nearest, value);
      farthest = std::max(farthest, value);
    }
  }
  return {{"source", log.scan_message},
          {"count", log.scans.size()},
          {"begin_s", first.timestamp},
          {"end_s", last.timestamp},
          {"rate_hz", ToJson(RateOf(static_cast<std::int64_t>(log.scans.size()),
                                    last.timestamp - first.timestamp))},
          {"longest_gap_s", gap},
          {"time_reversals", log.time_reversals},
          {"largest_time_reversal_s", log.largest_time_reversal},
          {"beams", first.ranges.size()},
          {"beam_count_changes", log.beam_count_changes},
          {"first_beam_deg", RadToDeg(first.start_angle)},
          {"step_deg", RadToDeg(first.angle_step)},
          {"maximum_range_m", first.maximum_range},
          {"returns_share", readings > 0 ? static_cast<double>(returns) /
                                               static_cast<double>(readings)
                                         : 0.0},
          {"nearest_m", nearest},
          {"farthest_m", farthest},
          {"laser_on_robot",
           {{"x_m", first.laser_offset[0]},
            {"y_m", first.laser_offset[1]},
            {"heading_deg", RadToDeg(first.laser_offset[2])}}}};
}

Json OdometryOf(const Log& log) {
  if (!log.has_odometry) {
    return {{"source", nullptr},
            {"instead", log.yaw_rates.empty()
                            ? "scan matching alone"
                            : "scan matching, with turn rates of " +
                                  log.yaw_rate_source + " where they fit"}};
  }
  double way = 0.0;
  double turned = 0.0;
  double largest_step = 0.0;
  double largest_turn = 0.0;
  std::int64_t standing = 0;
  for (std::size_t i = 1; i < log.scans.size(); ++i) {
    const Pose2 motion =
        Between(log.scans[i - 1].odometry, log.scans[i].odometry);
    const double step = motion.head<2>().norm();
    const double turn = std::abs(NormalizeAngle(motion[2]));
    way += step;
    turned += turn;
    largest_step = std::max(largest_step, step);
    largest_turn = std::max(largest_turn, turn);
    if (step == 0.0 && turn == 0.0) ++standing;
  }
  return {{"source", log.odometry_source.empty() ? log.scan_message
                                                 : log.odometry_source},
          {"way_m", way},
          {"turned_deg", RadToDeg(turned)},
          {"largest_step_m", largest_step},
          {"largest_turn_deg", RadToDeg(largest_turn)},
          {"scans_without_motion", standing}};
}

// Whether plumbline_solve takes the file for a graph. What can be read once
// only is left to the readers.
bool IsGraph(const std::string& path, const Registry& readers,
             const LaserOptions& options) {
  std::error_code error;
  if (!std::filesystem::is_regular_file(path, error) ||
      RecognizeLogPath(readers, path) != nullptr) {
    return false;
  }
  constexpr std::size_t kShown = std::size_t{1} << 16;
  InputStream input(path, options.stop);
  const std::string_view prefix = input.Peek(kShown);
  return RecognizeLog(readers, prefix) == nullptr && LooksLikeG2o(prefix);
}

Json Inspect(const std::string& path, const Registry& readers,
             LaserOptions options) {
  Json result = {{"input", path}};
  std::vector<LogTopic> topics;
  options.on_topics = [&](const std::vector<LogTopic>& t) { topics = t; };
  try {
    if (IsGraph(path, readers, options)) {
      result["format"] = kGraphFormat;
      result["topics"] = Json::array();
      result["refused"] = nullptr;
      return result;
    }
    const Log log = ReadLog(path, readers, options);
    if (topics.empty()) {
      for (const auto& [name, count] : log.messages) {
        LogTopic topic;
        topic.name = name;
        topic.messages = count;
        if (name == log.scan_message) topic.use = "scans";
        topics.push_back(topic);
      }
    }
    result["format"] = log.format.empty() ? "CARMEN log" : log.format;
    result["topics"] = TopicsOf(topics);
    result["scans"] = ScansOf(log);
    result["odometry"] = OdometryOf(log);
    result["notes"] = log.notes;
    result["skipped"] = Json::array();
    for (const SkipReport& skip : log.skipped) {
      result["skipped"].push_back(
          {{"reason", skip.reason},
           {"count", skip.count},
           {"first_" + log.position_unit + "s", skip.first_lines}});
    }
    result["refused"] = nullptr;
  } catch (const Error& error) {
    result["topics"] = TopicsOf(topics);
    result["refused"] = error.what();
  }
  return result;
}

[[gnu::format(printf, 2, 3)]] void AppendText(std::string* text,
                                              const char* format, ...) {
  va_list arguments;
  va_start(arguments, format);
  va_list again;
  va_copy(again, arguments);
  const int length = std::vsnprintf(nullptr, 0, format, arguments);
  va_end(arguments);
  const std::size_t before = text->size();
  // Its last byte, a zero, is dropped.
  text->resize(before + static_cast<std::size_t>(std::max(length, 0)) + 1);
  std::vsnprintf(text->data() + before, text->size() - before, format, again);
  va_end(again);
  text->pop_back();
}

std::string Text(const Json& value) {
  return PrintableUtf8(value.get<std::string>());
}

void AppendTopics(const Json& topics, std::string* text) {
  if (topics.empty()) return;
  AppendText(text, "\n%-32s %-28s %9s %9s %9s %6s  %s\n", "topic", "type",
             "messages", "rate, Hz", "gap, s", "back", "use");
  for (const Json& topic : topics) {
    AppendText(text, "%-32s %-28s %9lld", Text(topic["name"]).c_str(),
               Text(topic["type"]).c_str(),
               static_cast<long long>(topic["messages"].get<std::int64_t>()));
    if (topic.contains("rate_hz") && !topic["rate_hz"].is_null()) {
      AppendText(
          text, " %9.2f %9.3f %6lld", topic["rate_hz"].get<double>(),
          topic["longest_gap_s"].get<double>(),
          static_cast<long long>(topic["time_reversals"].get<std::int64_t>()));
    } else {
      AppendText(text, " %9s %9s %6s", "", "", "");
    }
    std::string use = Text(topic["use"]);
    if (topic.contains("why_not")) {
      use += (use.empty() ? "not used: " : "; ") + Text(topic["why_not"]);
    }
    AppendText(text, "  %s\n", use.c_str());
  }
}

std::string TextOf(const Json& result) {
  std::string text;
  AppendText(&text, "%s: %s\n", Text(result["input"]).c_str(),
             result.contains("format") ? Text(result["format"]).c_str()
                                       : "cannot be mapped");
  AppendTopics(result["topics"], &text);
  if (!result["refused"].is_null()) {
    AppendText(&text, "\nrefused: %s\n", Text(result["refused"]).c_str());
    return text;
  }
  if (!result.contains("scans")) {
    AppendText(&text,
               "\nIt is no log: there are no scans in it. plumbline_solve "
               "takes it as --input\n");
    return text;
  }
  const Json& scans = result["scans"];
  const auto number = [&scans](const char* key) {
    return scans[key].is_null() ? 0.0 : scans[key].get<double>();
  };
  AppendText(&text,
             "\nscans      %lld of %s, %.3f s to %.3f s, %.2f a second, "
             "longest gap %.3f s, %lld back in time\n",
             static_cast<long long>(number("count")),
             Text(scans["source"]).c_str(), number("begin_s"), number("end_s"),
             number("rate_hz"), number("longest_gap_s"),
             static_cast<long long>(number("time_reversals")));
  const double beams = number("beams");
  AppendText(&text,
             "laser      %.0f beams from %.2f to %.2f degrees, range %.2f m, "
             "returns %.1f %% (%.2f m to %.2f m)\n",
             beams, number("first_beam_deg"),
             number("first_beam_deg") + (beams - 1) * number("step_deg"),
             number("maximum_range_m"), 100.0 * number("returns_share"),
             number("nearest_m"), number("farthest_m"));
  const Json& place = scans["laser_on_robot"];
  AppendText(&text,
             "           on the robot at x %.3f m, y %.3f m, %.2f degrees\n",
             place["x_m"].get<double>(), place["y_m"].get<double>(),
             place["heading_deg"].get<double>());
  const Json& odometry = result["odometry"];
  if (odometry["source"].is_null()) {
    AppendText(&text, "odometry   none: %s\n",
               Text(odometry["instead"]).c_str());
  } else {
    AppendText(
        &text,
        "odometry   %s: %.2f m, %.0f degrees; largest step between scans "
        "%.3f m, %.2f degrees; %lld scans without motion\n",
        Text(odometry["source"]).c_str(), odometry["way_m"].get<double>(),
        odometry["turned_deg"].get<double>(),
        odometry["largest_step_m"].get<double>(),
        odometry["largest_turn_deg"].get<double>(),
        static_cast<long long>(
            odometry["scans_without_motion"].get<std::int64_t>()));
  }
  for (const Json& note : result["notes"]) {
    AppendText(&text, "note       %s\n", Text(note).c_str());
  }
  for (const Json& skip : result["skipped"]) {
    AppendText(&text, "skipped    %lld: %s\n",
               static_cast<long long>(skip["count"].get<std::int64_t>()),
               Text(skip["reason"]).c_str());
  }
  return text;
}

}  // namespace

LogInspection InspectLog(const std::string& path, const Registry& readers,
                         const LaserOptions& options) {
  const Json result = Inspect(path, readers, options);
  LogInspection inspection;
  inspection.is_refused = !result["refused"].is_null();
  inspection.json =
      result.dump(2, ' ', false, Json::error_handler_t::replace) + '\n';
  inspection.text = TextOf(result);
  return inspection;
}

}  // namespace plumbline
