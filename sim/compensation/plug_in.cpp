#include "sim/compensation/plug_in.h"

#include <algorithm>
#include <array>
#include <charconv>
#include <cmath>
#include <cstdio>
#include <cstdlib>
#include <fstream>
#include <iostream>
#include <limits>
#include <string_view>

#include <dlfcn.h>
#include <fcntl.h>
#include <fmt/format.h>
#include <unistd.h>
#include <nlohmann/json.hpp>

#include "kinematics/bad_input.h"
#include "kinematics/text.h"
#include "sim/compensation/abbe_compensator.h"
#include "sim/compensation/child_process.h"

namespace abbe::sim::compensation {

namespace {

using Eigen::Index;

constexpr std::array<const char*, 6> deviation_columns = {"EX", "EY", "EZ", "EA", "EB", "EC"};
constexpr double rpm_per_rad_per_s = 9.549296585513721;  // 30 / pi

bool is_angle(const ResponseRequirements& expected, Index column) {
  if (expected.output == PlugInOutput::Deviation) return column >= 3;
  return expected.task.joints[std::size_t(column)].motion != kinematics::Motion::Linear;
}

}  // namespace

Index reading_count(const PlugInTask& task) {
  return task.log.time_s.size() > 0 ? task.log.values.cols() : 0;
}

PlugInBatch make_batch(const PlugInTask& task, const PlugInRequest& question, Samples samples) {
  const Index n = samples.count, joints = Index(task.joints.size()), m = reading_count(task);
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

Index column_count(PlugInOutput output, const PlugInTask& task) {
  return output == PlugInOutput::Deviation ? 6 : Index(task.joints.size());
}

std::string column_name(const ResponseRequirements& expected, Index column) {
  if (expected.output == PlugInOutput::Deviation) return deviation_columns[std::size_t(column)];
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
const char* enum_key(PlugInOutput output) {
  return output == PlugInOutput::Correction ? "correction" : "deviation";
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
  if (json_depth(line) > max_nesting) throw_input_error(" that is nested too deeply");
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
                                     : " (write messages for users to stderr)");
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

std::string task_line(const PlugInTask& task, Eigen::Index samples, int batch_size) {
  ordered_json message = {{"abbe", protocol_version}, {"kind", "task"}};
  message["units"] = {{"length", "mm"}, {"angle", "rad"}, {"time", "s"}};
  message["structure"] = task.structure;
  message["joints"] = ordered_json::array();
  for (const kinematics::Joint& joint : task.joints)
    message["joints"].push_back(joint_message(joint));
  message["tool"] = {{"name", task.tool}, {"length", task.tool_length}};
  message["samples"] = samples;
  message["batch"] = batch_size;
  message["readings"] = reading_count(task) > 0 ? task.log.names : std::vector<std::string>();
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

std::string request_line(const PlugInBatch& batch, long id) {
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
    throw ChildProcessError(fmt::format("\"abbe\":{}, the protocol version", protocol_version),
                            shown_value(message, "abbe"));
  if (shown_value(message, "kind") != "\"ready\"")
    throw ChildProcessError("\"kind\":\"ready\"", shown_value(message, "kind"));
  Handshake handshake;
  const std::string answers = shown_value(message, "answers");
  if (answers == "\"deviation\"")
    handshake.output = PlugInOutput::Deviation;
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
  const auto rows_json = message.find(enum_key(expected.output));
  if (rows_json == message.end() || !rows_json->is_array())
    throw ChildProcessError(fmt::format("\"{}\":[...]", enum_key(expected.output)),
                            shown_value(message, enum_key(expected.output)));
  if (rows_json->size() != std::size_t(expected.samples))
    throw ChildProcessError(fmt::format("{} rows, one per sample", expected.samples),
                            std::to_string(rows_json->size()));
  Eigen::MatrixXd rows(expected.samples, column_count(expected.output, expected.task));
  for (Eigen::Index i = 0; i < rows.rows(); ++i) {
    const json& row = (*rows_json)[std::size_t(i)];
    if (!row.is_array() || row.size() != std::size_t(rows.cols()))
      throw ChildProcessError(fmt::format("{} numbers per row", rows.cols()),
                              row.is_array() ? fmt::format("{} in row {}", row.size(), i + 1)
                                             : fmt::format("no list in row {}", i + 1));
    for (Eigen::Index j = 0; j < rows.cols(); ++j)
      rows(i, j) = read_number(row[std::size_t(j)], expected, i, j);
  }
  return rows;
}

// Running of plug-ins, and the host process of shared libraries (plug_in_host in plug_in.h).

inline constexpr const char* host_argument = "plug-in-host";       ///< first argument of a host
inline constexpr const char* host_variable = "ABBE_PLUG_IN_HOST";  ///< set in its environment

namespace {

using nlohmann::json;
using NumberTable = std::vector<double>;  // rows one after another

constexpr const char* query_prefix = R"({"kind":"ask")";

/// Loads a library and returns its compensator object. It stays loaded until the process ends.
const abbe_compensator_v1& load_library(const char* library) {
  void* handle = dlopen(library, RTLD_NOW | RTLD_LOCAL);
  if (handle == nullptr) throw ChildProcessError("a shared library", dlerror());
  const void* symbol = dlsym(handle, "abbe_compensator");
  if (symbol == nullptr)
    throw ChildProcessError("the object abbe_compensator of abbe_compensator.h", "none");
  const auto& compensator = *static_cast<const abbe_compensator_v1*>(symbol);
  if (compensator.version != ABBE_COMPENSATOR_VERSION)
    throw ChildProcessError(
        fmt::format("version {} of abbe_compensator.h", ABBE_COMPENSATOR_VERSION),
        std::to_string(compensator.version));
  if (compensator.answers != ABBE_CORRECTION && compensator.answers != ABBE_DEVIATION)
    throw ChildProcessError("answers = ABBE_CORRECTION or ABBE_DEVIATION",
                            std::to_string(compensator.answers));
  if (compensator.answer == nullptr) throw ChildProcessError("a function answer", "NULL");
  return compensator;
}

/// Parses the list or table of numbers under a key of a line written by abbe; null becomes NaN. A
/// general JSON parser would take most of the time of a sample.
NumberTable parse_table(std::string_view line, const std::string& key) {
  NumberTable table;
  const std::string prefix = "\"" + key + "\":";
  const std::size_t start = line.find(prefix);
  if (start == std::string_view::npos) throw ChildProcessError(prefix, "none");
  const char* position = line.data() + start + prefix.size();
  const char* const end = line.data() + line.size();
  for (int depth = 0; position != end;) {
    const char c = *position;
    if (c == '[') ++depth;
    if (c == ']' && --depth == 0) break;
    if (c == '[' || c == ']' || c == ',') {
      ++position;
    } else if (c == 'n') {
      table.push_back(std::numeric_limits<double>::quiet_NaN());
      position += 4;
    } else {
      const auto [next, error_code] = std::from_chars(position, end, table.emplace_back());
      if (error_code != std::errc())
        throw ChildProcessError("numbers under " + key, quoted_excerpt({position, 1}));
      position = next;
    }
  }
  return table;
}

/// Converts a joint of the task message to the layout of abbe_compensator.h.
abbe_joint parse_joint(const json& message) {
  abbe_joint joint{};
  const std::string motion = message.at("motion");
  joint.name = message.at("name").get<std::string>().at(0);
  joint.side = message.at("side") == "tool" ? ABBE_TOOL_SIDE : ABBE_WORKPIECE_SIDE;
  joint.motion = motion == "linear" ? ABBE_LINEAR : motion == "rotary" ? ABBE_ROTARY : ABBE_SPINDLE;
  for (std::size_t i = 0; i < 3; ++i) {
    joint.direction[i] = message.at("direction").at(i);
    joint.point[i] = message.at("point").at(i);
  }
  joint.min = message.at("min");
  joint.max = message.at("max");
  return joint;
}

/// The task in the layout of abbe_compensator.h, with the memory to which its pointers refer.
struct HostTask {
  explicit HostTask(const std::string& line) : HostTask(line, json::parse(line)) {}
  HostTask(const std::string& line, const json& message)
      : structure(message.at("structure")),
        tool(message.at("tool").at("name")),
        names(message.at("readings")),
        time_s(parse_table(line, "time_s")),
        log(parse_table(line, "values")) {
    for (const json& joint : message.at("joints")) joints.push_back(parse_joint(joint));
    for (const std::string& name : names) name_pointers.push_back(name.c_str());
    c = {structure.c_str(),
         std::int32_t(joints.size()),
         joints.data(),
         tool.c_str(),
         message.at("tool").at("length"),
         message.at("samples"),
         std::int32_t(names.size()),
         name_pointers.data(),
         std::int64_t(time_s.size()),
         time_s.data(),
         log.data()};
  }
  HostTask(const HostTask&) = delete;
  HostTask& operator=(const HostTask&) = delete;

  std::string structure, tool;
  std::vector<abbe_joint> joints;
  std::vector<std::string> names;
  std::vector<const char*> name_pointers;
  NumberTable time_s, log;
  abbe_task c{};
};

/// Reads the next line from stdin; an empty one at the end.
std::string next_line() {
  std::string line;
  std::getline(std::cin, line);
  return line;
}

/// Throws if a function of the library failed, with the error text of the library if there is one.
void check_result(std::int32_t result, const char* function, const std::string& error) {
  if (result != 0)
    throw std::runtime_error(
        error.c_str()[0] != '\0' ? error.c_str() : fmt::format("{} returned {}", function, result));
}

/// Calls the library for a batch and returns the message with its answer.
std::string response_line(const abbe_compensator_v1& compensator, void* instance,
                          const HostTask& task, const std::string& ask, long id) {
  const NumberTable time_s = parse_table(ask, "time_s"), q = parse_table(ask, "q"),
                    direction = parse_table(ask, "direction"),
                    rpm = parse_table(ask, "spindle_rpm"), T_wt = parse_table(ask, "T_wt"),
                    readings = parse_table(ask, "readings");
  const abbe_batch batch{std::int64_t(time_s.size()),
                         time_s.data(),
                         q.data(),
                         direction.data(),
                         rpm.data(),
                         T_wt.data(),
                         readings.data()};
  const bool is_correction = compensator.answers == ABBE_CORRECTION;
  const std::size_t columns_per_row = is_correction ? task.joints.size() : 6;
  // A number that the library does not write remains NaN, which abbe rejects.
  NumberTable rows(time_s.size() * columns_per_row, std::numeric_limits<double>::quiet_NaN());
  std::string error(ABBE_ERROR_BYTES, '\0');
  check_result(compensator.answer(instance, &batch, rows.data(), error.data()), "answer", error);

  std::string line =
      fmt::format("{{\"id\":{},\"{}\":[", id, is_correction ? "correction" : "deviation");
  for (std::size_t i = 0; i < rows.size(); ++i) {
    line += i == 0 ? "[" : i % columns_per_row == 0 ? "],[" : ",";
    append_number(line, rows[i]);
  }
  return line + (rows.empty() ? "]}" : "]]}");
}

/// Returns the message as JSON on one line, invalid UTF-8 replaced.
std::string json_text_line(const json& message) {
  return message.dump(-1, ' ', false, json::error_handler_t::replace);
}

void write_line(std::FILE* stream, const std::string& line) {
  std::fwrite(line.data(), 1, line.size(), stream);
  std::fputc('\n', stream);
  std::fflush(stream);
}

/// Answers the messages of abbe with the compensator of a library until the end message.
void serve(const char* library, std::FILE* stream) {
  const abbe_compensator_v1& compensator = load_library(library);
  const HostTask task(next_line());
  void* instance = nullptr;
  if (compensator.open != nullptr) {
    std::string error(ABBE_ERROR_BYTES, '\0');
    check_result(compensator.open(&instance, &task.c, error.data()), "open", error);
  }
  write_line(stream,
             json_text_line({{"abbe", protocol_version},
                             {"kind", "ready"},
                             {"name", compensator.name != nullptr ? compensator.name : ""},
                             {"answers", compensator.answers == ABBE_CORRECTION ? "correction"
                                                                                : "deviation"}}));
  long id = 0;
  for (std::string line = next_line(); line.rfind(query_prefix, 0) == 0; line = next_line())
    write_line(stream, response_line(compensator, instance, task, line, ++id));
  if (compensator.close != nullptr) compensator.close(instance);
}

}  // namespace

std::optional<int> plug_in_host(int argc, char** argv) {
  if (argc != 3 || std::string_view(argv[1]) != host_argument) return std::nullopt;
  std::ios::sync_with_stdio(false);
  // Output of the library must not mix with the answers, so stdout is redirected to stderr, and
  // answers are written to a duplicate of the original stdout.
  std::FILE* stream = fdopen(fcntl(STDOUT_FILENO, F_DUPFD_CLOEXEC, 3), "w");
  dup2(STDERR_FILENO, STDOUT_FILENO);
  if (stream == nullptr) return 1;
  try {
    serve(argv[2], stream);
  } catch (const std::exception& error) {
    write_line(stream, json_text_line({{"error", error.what()}}));
  }
  std::fclose(stream);
  return 0;
}

namespace {

namespace fs = std::filesystem;

constexpr std::size_t line_base_bytes = 65536;  // bytes allowed for any line
constexpr std::size_t bytes_per_number = 64;    // longer than any notation of a double

/// The command and the additional environment with which a plug-in is started.
struct LaunchCommand {
  std::vector<std::string> command;
  std::vector<std::string> environment;
};

/// Returns true if a file begins with #!.
bool has_shebang(const fs::path& file) {
  std::array<char, 2> prefix{};
  std::ifstream(file, std::ios::binary).read(prefix.data(), 2);
  return prefix[0] == '#' && prefix[1] == '!';
}

/// Returns how to start a plug-in, by the type of its file.
LaunchCommand launch_command(const fs::path& plug_in, const PlugInOptions& options) {
  std::error_code error_code;
  const fs::file_status status = fs::status(plug_in, error_code);
  if (!fs::exists(status)) throw ChildProcessError("a program or a shared library", "no such file");
  if (!fs::is_regular_file(status))
    throw ChildProcessError("a program or a shared library",
                            fs::is_directory(status) ? "a folder" : "something that is not a file");
  const std::string path = fs::absolute(plug_in).string();
  LaunchCommand launch;
  // Without this variable Python buffers its output to a pipe.
  if (std::getenv("PYTHONUNBUFFERED") == nullptr) launch.environment = {"PYTHONUNBUFFERED=1"};
  const bool is_executable = ::access(path.c_str(), X_OK) == 0;
  if (plug_in.extension() == ".so") {
    // The variable is set in a host. If it is set here, the host ran its normal main and would
    // start itself for ever.
    if (std::getenv(host_variable) != nullptr)
      throw ChildProcessError("a host whose main calls plug_in_host first", "a host that does not");
    launch.environment.push_back(fmt::format("{}=1", host_variable));
    launch.command = {options.host.string(), host_argument, path};
  } else if (plug_in.extension() == ".py" && !(is_executable && has_shebang(plug_in))) {
    launch.command = {"python3", path};
  } else if (is_executable) {
    launch.command = {path};
  } else {
    throw ChildProcessError("an executable program (chmod +x), a .py file or a .so file",
                            "none of these");
  }
  return launch;
}

/// Replaces bytes that are not UTF-8, so that reports can contain the text.
std::string replace_invalid_utf8(const std::string& text) {
  const nlohmann::json value = text;
  return nlohmann::json::parse(value.dump(-1, ' ', false, nlohmann::json::error_handler_t::replace))
      .get<std::string>();
}

/// Returns the lines with two spaces before each.
std::string indented(std::string lines) {
  for (std::size_t position = lines.find('\n'); position != std::string::npos;
       position = lines.find('\n', position + 3))
    lines.replace(position, 1, "\n  ");
  return "  " + lines;
}

/// The exchange of messages with a plug-in. An error names the plug-in and the step, and quotes its
/// last lines on stderr.
class Conversation {
 private:
  template <typename Action>
  auto run_step(const std::string& name, const Action& action) {
    try {
      return action();
    } catch (const ChildProcessError& error) {
      std::string text =
          fmt::format("{}: {}: {}", escaped(plug_in_.string()), name, escaped(error.what()));
      if (child_ && !child_->stderr_tail().empty())
        text += "\nlast lines on stderr:\n" + indented(child_->stderr_tail());
      throw PlugInFailure(replace_invalid_utf8(text));
    }
  }

 public:
  Conversation(const fs::path& plug_in, const PlugInOptions& options)
      : plug_in_(plug_in), options_(options) {
    run_step("start", [&] {
      const LaunchCommand launch = launch_command(plug_in, options);
      child_.emplace(launch.command, launch.environment, options_.on_wait);
    });
  }

  Handshake exchange_handshake(const PlugInTask& task, Eigen::Index samples) {
    return run_step("handshake", [&] {
      const std::string line = task_line(task, samples, options_.batch_size);
      return read_handshake(child_->exchange(line, {options_.start_s, line_base_bytes}));
    });
  }

  Eigen::MatrixXd ask_batch(const PlugInRequest& question, Samples samples,
                            const ResponseRequirements& expected) {
    return run_step(batch_label(expected.id, samples), [&] {
      const std::string line =
          request_line(make_batch(expected.task, question, samples), expected.id);
      const auto numbers = samples.count * column_count(expected.output, expected.task);
      return read_response(
          child_->exchange(line, {options_.response_s,
                                  line_base_bytes + bytes_per_number * std::size_t(numbers)}),
          expected);
    });
  }

  std::string finish() {
    run_step("end", [&] { child_->finish(end_line(), options_.response_s); });
    return replace_invalid_utf8(child_->stderr_tail());
  }

 private:
  fs::path plug_in_;
  PlugInOptions options_;
  std::optional<ChildProcess> child_;
};

void check_question(const PlugInRequest& question, const PlugInOptions& options) {
  if (question.T_wt.size() != question.commands.size())
    throw std::invalid_argument("expected one pose per command");
  if (options.batch_size < 1)
    throw std::invalid_argument("expected a batch of at least one sample");
}

/// Asks for all batches of a question and returns the rows of all answers.
/// @param rows  function that returns the answer to one batch
template <typename Rows>
Eigen::MatrixXd ask_in_batches(const PlugInTask& task, const PlugInRequest& question,
                               const PlugInOptions& options, PlugInOutput output,
                               const Rows& rows) {
  const Eigen::Index samples = Eigen::Index(question.commands.size());
  Eigen::MatrixXd all_rows(samples, column_count(output, task));
  long id = 0;
  for (Samples batch; batch.first < samples; batch.first += batch.count) {
    batch.count = std::min<Eigen::Index>(options.batch_size, samples - batch.first);
    all_rows.middleRows(batch.first, batch.count) =
        rows(batch, ResponseRequirements{++id, output, batch.count, task, options});
  }
  return all_rows;
}

/// Throws ChildProcessError unless the answer of a function has the expected size and values.
void check_response(const Eigen::MatrixXd& rows, const ResponseRequirements& expected) {
  const Eigen::Index response_width = column_count(expected.output, expected.task);
  if (rows.rows() != expected.samples || rows.cols() != response_width)
    throw ChildProcessError(fmt::format("{} rows of {} numbers", expected.samples, response_width),
                            fmt::format("{} of {}", rows.rows(), rows.cols()));
  for (Eigen::Index i = 0; i < rows.rows(); ++i)
    for (Eigen::Index j = 0; j < response_width; ++j)
      if (const auto requirement = violated_requirement(rows(i, j), expected, j))
        throw ChildProcessError(*requirement, fmt::format("{} in row {}, {}", rows(i, j), i + 1,
                                                          column_name(expected, j)));
}

}  // namespace

PlugInResponse ask(const fs::path& plug_in, const PlugInTask& task, const PlugInRequest& question,
                   const PlugInOptions& options) {
  check_question(question, options);
  Conversation conversation(plug_in, options);
  const Handshake handshake =
      conversation.exchange_handshake(task, Eigen::Index(question.commands.size()));
  PlugInResponse response{replace_invalid_utf8(handshake.name), handshake.output, {}, {}};
  response.rows = ask_in_batches(task, question, options, handshake.output,
                                 [&](Samples batch, const ResponseRequirements& expected) {
                                   return conversation.ask_batch(question, batch, expected);
                                 });
  response.stderr_text = conversation.finish();
  return response;
}

PlugInResponse ask(const std::string& name, const PlugInFunction& function, const PlugInTask& task,
                   const PlugInRequest& question, const PlugInOptions& options) {
  check_question(question, options);
  const auto rows = [&](Samples batch, const ResponseRequirements& expected) {
    // A function can be interrupted between batches, as a process can.
    if (options.on_wait) options.on_wait();
    Eigen::MatrixXd response = function.rows(task, make_batch(task, question, batch));
    try {
      check_response(response, expected);
    } catch (const ChildProcessError& error) {
      throw PlugInFailure(replace_invalid_utf8(fmt::format(
          "{}: {}: {}", escaped(name), batch_label(expected.id, batch), escaped(error.what()))));
    }
    return response;
  };
  return {
      name, function.output, ask_in_batches(task, question, options, function.output, rows), {}};
}

}  // namespace abbe::sim::compensation
