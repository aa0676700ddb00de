#include "sim/compensation/plug_in_protocol.h"

#include <array>
#include <charconv>
#include <cmath>

#include <fmt/format.h>
#include <nlohmann/json.hpp>

#include "kinematics/text.h"
#include "sim/compensation/child_process.h"

namespace abbe::sim::compensation {

namespace {

using Eigen::Index;

constexpr std::array<const char*, 6> deviation_columns = {"EX", "EY", "EZ", "EA", "EB", "EC"};
constexpr double rpm_per_rad_per_s = 9.549296585513721;  // 30 / pi

bool is_angle(const ResponseRequirements& expected, Index column) {
  if (expected.answers == PlugInOutput::Deviation) return column >= 3;
  return expected.task.joints[std::size_t(column)].motion != kinematics::Motion::Linear;
}

}  // namespace

Index readings(const PlugInTask& task) {
  return task.log.time_s.size() > 0 ? task.log.values.cols() : 0;
}

PlugInBatch make_batch(const PlugInTask& task, const PlugInQuestion& question, Samples samples) {
  const Index n = samples.count, joints = Index(task.joints.size()), m = readings(task);
  PlugInBatch batch{Eigen::VectorXd(n), PlugInBatch::Rows(n, joints), PlugInBatch::Rows(n, joints),
                    Eigen::VectorXd(n), PlugInBatch::Rows(n, 12),     PlugInBatch::Rows(n, m)};
  for (Index i = 0; i < n; ++i) {
    const kinematics::AxisState& state = question.commands[std::size_t(samples.first + i)];
    const kinematics::Pose& T_wt = question.T_wt[std::size_t(samples.first + i)];
    batch.time_s[i] = state.time_s;
    batch.q.row(i) = state.q.transpose();
    for (Index j = 0; j < joints; ++j)
      batch.direction(i, j) = double(state.direction[std::size_t(j)]);
    batch.spindle_rpm[i] = state.spindle_speed * rpm_per_rad_per_s;
    for (Index k = 0; k < 12; ++k) batch.T_wt(i, k) = T_wt.matrix()(k / 4, k % 4);
    if (m > 0) batch.readings.row(i) = task.log.values.row(row_at(task.log, state.time_s));
  }
  return batch;
}

Index columns(PlugInOutput answers, const PlugInTask& task) {
  return answers == PlugInOutput::Deviation ? 6 : Index(task.joints.size());
}

std::string column_name(const ResponseRequirements& expected, Index column) {
  if (expected.answers == PlugInOutput::Deviation) return deviation_columns[std::size_t(column)];
  return std::string(1, expected.task.joints[std::size_t(column)].name);
}

std::optional<std::string> violated_requirement(double number, const ResponseRequirements& expected,
                                                Index column) {
  if (!std::isfinite(number)) return "a finite number";
  // A larger value probably has the wrong unit, such as um instead of mm.
  const bool is_angle_column = is_angle(expected, column);
  const double limit = is_angle_column ? expected.options.max_rad : expected.options.max_mm;
  if (std::abs(number) <= limit) return std::nullopt;
  return fmt::format("at most {} {} (units are mm and rad)", limit, is_angle_column ? "rad" : "mm");
}

std::string batch_label(long id, Samples samples) {
  return fmt::format("batch {} (samples {} to {})", id, samples.first + 1,
                     samples.first + samples.count);
}

namespace {

using nlohmann::json;
using nlohmann::ordered_json;

/// Returns the key of the numbers in the messages.
const char* enum_key(PlugInOutput answers) {
  return answers == PlugInOutput::Correction ? "correction" : "deviation";
}

template <typename Value>
void append_list(std::string& line, Eigen::Index n, const Value& value) {
  line += '[';
  for (Eigen::Index i = 0; i < n; ++i) {
    if (i > 0) line += ',';
    value(i);
  }
  line += ']';
}

template <typename Value>
void append_numbers(std::string& line, Eigen::Index n, const Value& value) {
  append_list(line, n, [&](Eigen::Index i) { append_number(line, value(i)); });
}

// Bytes that are not UTF-8 are replaced, because the name of a tool may contain any.
std::string text_line(const ordered_json& message) {
  return message.dump(-1, ' ', false, json::error_handler_t::replace) + "\n";
}

std::vector<double> numbers(const Eigen::Vector3d& v) { return {v.x(), v.y(), v.z()}; }

const char* enum_key(kinematics::Motion motion) {
  switch (motion) {
    case kinematics::Motion::Linear:
      return "linear";
    case kinematics::Motion::Rotary:
      return "rotary";
    case kinematics::Motion::Spindle:
      return "spindle";
  }
  return "";
}

ordered_json joint_message(const kinematics::Joint& joint) {
  return {{"name", std::string(1, joint.name)},
          {"side", joint.side == kinematics::Side::Workpiece ? "workpiece" : "tool"},
          {"motion", enum_key(joint.motion)},
          {"direction", numbers(joint.direction_b)},
          {"point", numbers(joint.point_b)},
          {"min", joint.min},
          {"max", joint.max}};
}

json parse_message(const std::string& line) {
  const auto throw_input_error = [&](const char* why) {
    throw ChildProcessError("a JSON object on one line", quoted_excerpt(line) + why);
  };
  // The parser recurses, so deep nesting would exhaust the stack.
  if (json_depth(line) > max_nesting) throw_input_error(" that nests too deeply");
  json message;
  try {
    message = json::parse(line);
  } catch (const json::out_of_range&) {
    throw_input_error(" with a number that is too large");
  } catch (const json::exception&) {
    // Python writes NaN and Infinity, which are not JSON; they have a message of their own.
    const bool has_non_finite = line.find("NaN") != std::string::npos ||
                                line.find("nan") != std::string::npos ||
                                line.find("Infinity") != std::string::npos;
    throw_input_error(has_non_finite ? " with a number that is not finite"
                                     : " (messages for people go to stderr)");
  }
  if (!message.is_object()) throw_input_error("");
  if (const auto error = message.find("error"); error != message.end() && !error->is_null())
    throw ChildProcessError("no error",
                            error->is_string() ? error->get<std::string>() : error->dump());
  return message;
}

/// Returns the text of a value for an error message.
std::string shown_value(const json& object, const char* key) {
  const auto value = object.find(key);
  if (value == object.end()) return "none";
  return shown(value->dump(-1, ' ', true, json::error_handler_t::replace));
}

double read_number(const json& value, const ResponseRequirements& expected, Eigen::Index row,
                   Eigen::Index column) {
  const auto throw_input_error = [&](const std::string& requirement) {
    throw ChildProcessError(
        requirement, fmt::format("{} in row {}, {}",
                                 shown(value.dump(-1, ' ', true, json::error_handler_t::replace)),
                                 row + 1, column_name(expected, column)));
  };
  if (!value.is_number()) throw_input_error("a finite number");
  const double number = value.get<double>();
  if (const auto requirement = violated_requirement(number, expected, column))
    throw_input_error(*requirement);
  return number;
}

}  // namespace

void append_number(std::string& line, double number) {
  if (!std::isfinite(number)) {
    line += "null";
    return;
  }
  std::array<char, 32> digits;  // "-2.2250738585072014e-308" is the longest
  line.append(digits.data(),
              std::to_chars(digits.data(), digits.data() + digits.size(), number).ptr);
}

std::string task_line(const PlugInTask& task, Eigen::Index samples, int batch) {
  ordered_json message = {{"abbe", protocol_version}, {"kind", "task"}};
  message["units"] = {{"length", "mm"}, {"angle", "rad"}, {"time", "s"}};
  message["structure"] = task.structure;
  message["joints"] = ordered_json::array();
  for (const kinematics::Joint& joint : task.joints)
    message["joints"].push_back(joint_message(joint));
  message["tool"] = {{"name", task.tool}, {"length", task.tool_length}};
  message["samples"] = samples;
  message["batch"] = batch;
  message["readings"] = readings(task) > 0 ? task.log.names : std::vector<std::string>();
  std::string line = text_line(message);
  line.resize(line.size() - 2);  // the closing brace follows after the log

  const ControlLog& log = task.log;
  line += ",\"log\":{\"time_s\":";
  append_numbers(line, log.time_s.size(), [&](Eigen::Index i) { return log.time_s[i]; });
  line += ",\"values\":";
  append_list(line, log.time_s.size(), [&](Eigen::Index i) {
    append_numbers(line, log.values.cols(), [&](Eigen::Index j) { return log.values(i, j); });
  });
  return line + "}}\n";
}

std::string end_line() { return "{\"kind\":\"end\"}\n"; }

std::string ask_line(const PlugInBatch& batch, long id) {
  const Eigen::Index samples = batch.time_s.size();
  const auto size = std::size_t(batch.q.cols() + batch.direction.cols() + batch.readings.cols());
  std::string line = fmt::format("{{\"kind\":\"ask\",\"id\":{}", id);
  // An upper estimate of the length avoids copies of a line of megabytes.
  line.reserve(std::size_t(samples) * (300 + 10 * size));
  const auto append_entry = [&](const char* key, const auto& value) {
    line += fmt::format(",\"{}\":", key);
    append_list(line, samples, value);
  };
  const auto append_column = [&](const char* key, const Eigen::VectorXd& column) {
    append_entry(key, [&](Eigen::Index i) { append_number(line, column[i]); });
  };
  const auto append_rows = [&](const char* key, const PlugInBatch::Rows& rows) {
    append_entry(key, [&](Eigen::Index i) {
      append_numbers(line, rows.cols(), [&](Eigen::Index j) { return rows(i, j); });
    });
  };
  append_column("time_s", batch.time_s);
  append_rows("q", batch.q);
  append_rows("direction", batch.direction);
  append_column("spindle_rpm", batch.spindle_rpm);
  append_rows("T_wt", batch.T_wt);
  append_rows("readings", batch.readings);
  return line + "}\n";
}

Handshake read_handshake(const std::string& line) {
  const json message = parse_message(line);
  if (shown_value(message, "abbe") != std::to_string(protocol_version))
    throw ChildProcessError(
        fmt::format("\"abbe\":{}, the version of the protocol", protocol_version),
        shown_value(message, "abbe"));
  if (shown_value(message, "kind") != "\"ready\"")
    throw ChildProcessError("\"kind\":\"ready\"", shown_value(message, "kind"));
  Handshake handshake;
  const std::string answers = shown_value(message, "answers");
  if (answers == "\"deviation\"")
    handshake.answers = PlugInOutput::Deviation;
  else if (answers != "\"correction\"")
    throw ChildProcessError(R"("answers":"correction" or "answers":"deviation")", answers);
  if (const auto name = message.find("name"); name != message.end() && name->is_string())
    handshake.name = name->get<std::string>();
  return handshake;
}

Eigen::MatrixXd read_response(const std::string& line, const ResponseRequirements& expected) {
  const json message = parse_message(line);
  if (shown_value(message, "id") != std::to_string(expected.id))
    throw ChildProcessError(fmt::format("\"id\":{}", expected.id), shown_value(message, "id"));
  const auto rows_json = message.find(enum_key(expected.answers));
  if (rows_json == message.end() || !rows_json->is_array())
    throw ChildProcessError(fmt::format("\"{}\":[...]", enum_key(expected.answers)),
                            shown_value(message, enum_key(expected.answers)));
  if (rows_json->size() != std::size_t(expected.samples))
    throw ChildProcessError(fmt::format("{} rows, one a sample", expected.samples),
                            std::to_string(rows_json->size()));
  Eigen::MatrixXd rows(expected.samples, columns(expected.answers, expected.task));
  for (Eigen::Index i = 0; i < rows.rows(); ++i) {
    const json& row = (*rows_json)[std::size_t(i)];
    if (!row.is_array() || row.size() != std::size_t(rows.cols()))
      throw ChildProcessError(fmt::format("{} numbers a row", rows.cols()),
                              row.is_array() ? fmt::format("{} in row {}", row.size(), i + 1)
                                             : fmt::format("no list in row {}", i + 1));
    for (Eigen::Index j = 0; j < rows.cols(); ++j)
      rows(i, j) = read_number(row[std::size_t(j)], expected, i, j);
  }
  return rows;
}

}  // namespace abbe::sim::compensation
