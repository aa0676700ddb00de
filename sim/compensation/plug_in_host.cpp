#include "sim/compensation/plug_in_host.h"

#include <charconv>
#include <cstdio>
#include <iostream>
#include <limits>
#include <string_view>

#include <dlfcn.h>
#include <fcntl.h>
#include <unistd.h>

#include <fmt/format.h>
#include <nlohmann/json.hpp>

#include "kinematics/text.h"
#include "sim/compensation/abbe_compensator.h"
#include "sim/compensation/child_process.h"
#include "sim/compensation/json_lines.h"

namespace abbe::sim::compensation {
namespace {

using nlohmann::json;
using Table = std::vector<double>;  // rows one after another

constexpr const char* ask_begins = R"({"kind":"ask")";

/// The library's one object. The library stays loaded until the process ends.
const abbe_compensator_v1& loaded(const char* library) {
  void* handle = dlopen(library, RTLD_NOW | RTLD_LOCAL);
  if (handle == nullptr) throw ChildFault("a shared library", dlerror());
  const void* symbol = dlsym(handle, "abbe_compensator");
  if (symbol == nullptr)
    throw ChildFault("the object abbe_compensator of abbe_compensator.h", "none");
  const auto& compensator = *static_cast<const abbe_compensator_v1*>(symbol);
  if (compensator.version != ABBE_COMPENSATOR_VERSION)
    throw ChildFault(fmt::format("version {} of abbe_compensator.h", ABBE_COMPENSATOR_VERSION),
                     std::to_string(compensator.version));
  if (compensator.answers != ABBE_CORRECTION && compensator.answers != ABBE_DEVIATION)
    throw ChildFault("answers = ABBE_CORRECTION or ABBE_DEVIATION",
                     std::to_string(compensator.answers));
  if (compensator.answer == nullptr) throw ChildFault("a function answer", "NULL");
  return compensator;
}

/// The numbers of the list or table under a key of a line that abbe wrote, NaN for null. A reader
/// of any JSON would take most of the time that a sample costs.
Table table_in(std::string_view line, const std::string& key) {
  Table table;
  const std::string mark = "\"" + key + "\":";
  const std::size_t found = line.find(mark);
  if (found == std::string_view::npos) throw ChildFault(mark, "none");
  const char* at = line.data() + found + mark.size();
  const char* const end = line.data() + line.size();
  for (int depth = 0; at != end;) {
    const char c = *at;
    if (c == '[') ++depth;
    if (c == ']' && --depth == 0) break;
    if (c == '[' || c == ']' || c == ',') {
      ++at;
    } else if (c == 'n') {
      table.push_back(std::numeric_limits<double>::quiet_NaN());
      at += 4;
    } else {
      const auto [next, failure] = std::from_chars(at, end, table.emplace_back());
      if (failure != std::errc()) throw ChildFault("numbers under " + key, in_quotes({at, 1}));
      at = next;
    }
  }
  return table;
}

abbe_joint joint_of(const json& message) {
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

/// The task with the memory that its pointers point to.
struct Task {
  explicit Task(const std::string& line) : Task(line, json::parse(line)) {}
  Task(const std::string& line, const json& message)
      : structure(message.at("structure")),
        tool(message.at("tool").at("name")),
        names(message.at("readings")),
        time_s(table_in(line, "time_s")),
        log(table_in(line, "values")) {
    for (const json& joint : message.at("joints")) joints.push_back(joint_of(joint));
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
  Task(const Task&) = delete;
  Task& operator=(const Task&) = delete;

  std::string structure, tool;
  std::vector<abbe_joint> joints;
  std::vector<std::string> names;
  std::vector<const char*> name_pointers;
  Table time_s, log;
  abbe_task c{};
};

/// The next line, or nothing at the end.
std::string next_line() {
  std::string line;
  std::getline(std::cin, line);
  return line;
}

void check(std::int32_t failed, const char* function, const std::string& error) {
  if (failed != 0)
    throw std::runtime_error(
        error.c_str()[0] != '\0' ? error.c_str() : fmt::format("{} returned {}", function, failed));
}

std::string answer_line(const abbe_compensator_v1& compensator, void* self, const Task& task,
                        const std::string& ask, long id) {
  const Table time_s = table_in(ask, "time_s"), q = table_in(ask, "q"),
              direction = table_in(ask, "direction"), rpm = table_in(ask, "spindle_rpm"),
              T_wt = table_in(ask, "T_wt"), readings = table_in(ask, "readings");
  const abbe_batch batch{std::int64_t(time_s.size()),
                         time_s.data(),
                         q.data(),
                         direction.data(),
                         rpm.data(),
                         T_wt.data(),
                         readings.data()};
  const bool correction = compensator.answers == ABBE_CORRECTION;
  const std::size_t width = correction ? task.joints.size() : 6;
  Table rows(time_s.size() * width, std::numeric_limits<double>::quiet_NaN());
  std::string error(ABBE_ERROR_BYTES, '\0');
  check(compensator.answer(self, &batch, rows.data(), error.data()), "answer", error);

  std::string line =
      fmt::format("{{\"id\":{},\"{}\":[", id, correction ? "correction" : "deviation");
  for (std::size_t i = 0; i < rows.size(); ++i) {
    line += i == 0 ? "[" : i % width == 0 ? "],[" : ",";
    append_number(line, rows[i]);
  }
  return line + (rows.empty() ? "]}" : "]]}");
}

std::string line_of(const json& message) {
  return message.dump(-1, ' ', false, json::error_handler_t::replace);
}

void say(std::FILE* to, const std::string& line) {
  std::fwrite(line.data(), 1, line.size(), to);
  std::fputc('\n', to);
  std::fflush(to);
}

void converse(const char* library, std::FILE* to) {
  const abbe_compensator_v1& compensator = loaded(library);
  const Task task(next_line());
  void* self = nullptr;
  if (compensator.open != nullptr) {
    std::string error(ABBE_ERROR_BYTES, '\0');
    check(compensator.open(&self, &task.c, error.data()), "open", error);
  }
  say(to,
      line_of({{"abbe", protocol_version},
               {"kind", "ready"},
               {"name", compensator.name != nullptr ? compensator.name : ""},
               {"answers", compensator.answers == ABBE_CORRECTION ? "correction" : "deviation"}}));
  long id = 0;
  for (std::string line = next_line(); line.rfind(ask_begins, 0) == 0; line = next_line())
    say(to, answer_line(compensator, self, task, line, ++id));
  if (compensator.close != nullptr) compensator.close(self);
}

}  // namespace

std::optional<int> plug_in_host(int argc, char** argv) {
  if (argc != 3 || std::string_view(argv[1]) != host_word) return std::nullopt;
  std::ios::sync_with_stdio(false);
  // what the library prints is for people and must not stand among the answers
  std::FILE* to = fdopen(fcntl(STDOUT_FILENO, F_DUPFD_CLOEXEC, 3), "w");
  dup2(STDERR_FILENO, STDOUT_FILENO);
  if (to == nullptr) return 1;
  try {
    converse(argv[2], to);
  } catch (const std::exception& fault) {
    say(to, line_of({{"error", fault.what()}}));
  }
  std::fclose(to);
  return 0;
}

}  // namespace abbe::sim::compensation
