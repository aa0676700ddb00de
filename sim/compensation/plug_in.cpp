#include "sim/compensation/plug_in.h"

#include <algorithm>
#include <array>
#include <cstdlib>
#include <fstream>

#include <unistd.h>

#include <fmt/format.h>
#include <nlohmann/json.hpp>

#include "kinematics/escape.h"
#include "sim/compensation/child_process.h"
#include "sim/compensation/json_lines.h"
#include "sim/compensation/plug_in_host.h"

namespace abbe::sim::compensation {
namespace {

namespace fs = std::filesystem;

constexpr std::size_t line_base = 65536;      // bytes that any line may have
constexpr std::size_t bytes_per_number = 64;  // more than any spelling of a double needs

/// How a plug-in is started.
struct Start {
  std::vector<std::string> command;
  std::vector<std::string> environment;
};

bool begins_as_script(const fs::path& file) {
  std::array<char, 2> mark{};
  std::ifstream(file, std::ios::binary).read(mark.data(), 2);
  return mark[0] == '#' && mark[1] == '!';
}

Start start_of(const fs::path& plug_in, const PlugInOptions& options) {
  std::error_code failure;
  const fs::file_status status = fs::status(plug_in, failure);
  if (!fs::exists(status)) throw ChildFault("a program or a shared library", "no such file");
  if (!fs::is_regular_file(status))
    throw ChildFault("a program or a shared library",
                     fs::is_directory(status) ? "a folder" : "something else");
  const std::string path = fs::absolute(plug_in).string();
  Start start;
  // or a Python program that is not run by a terminal would keep its lines to itself
  if (std::getenv("PYTHONUNBUFFERED") == nullptr) start.environment = {"PYTHONUNBUFFERED=1"};
  const bool executable = ::access(path.c_str(), X_OK) == 0;
  if (plug_in.extension() == ".so") {
    if (std::getenv(host_mark) != nullptr)
      throw ChildFault("a host whose main begins with plug_in_host", "one that does not");
    start.environment.push_back(fmt::format("{}=1", host_mark));
    start.command = {options.host.string(), host_word, path};
  } else if (plug_in.extension() == ".py" && !(executable && begins_as_script(plug_in))) {
    start.command = {"python3", path};
  } else if (executable) {
    start.command = {path};
  } else {
    throw ChildFault("a program that may be run (chmod +x), a .py file or a .so file",
                     "a file that is none of these");
  }
  return start;
}

/// The same text with bytes that are not UTF-8 replaced, so that it can go into any report.
std::string as_utf8(const std::string& text) {
  const nlohmann::json value = text;
  return nlohmann::json::parse(value.dump(-1, ' ', false, nlohmann::json::error_handler_t::replace))
      .get<std::string>();
}

std::string indented(std::string lines) {
  for (std::size_t at = lines.find('\n'); at != std::string::npos; at = lines.find('\n', at + 3))
    lines.replace(at, 1, "\n  ");
  return "  " + lines;
}

/// A conversation whose every fault is reported with the plug-in, the step and its last words.
class Conversation {
 private:
  template <typename Do>
  auto step(const std::string& name, const Do& act) {
    try {
      return act();
    } catch (const ChildFault& fault) {
      std::string text =
          fmt::format("{}: {}: {}", escaped(plug_in_.string()), name, escaped(fault.what()));
      if (child_ && !child_->last_words().empty())
        text += "\nits last words on stderr:\n" + indented(child_->last_words());
      throw PlugInFailure(as_utf8(text));
    }
  }

 public:
  Conversation(const fs::path& plug_in, const PlugInOptions& options)
      : plug_in_(plug_in), options_(options) {
    step("start", [&] {
      const Start start = start_of(plug_in, options);
      child_.emplace(start.command, start.environment, options_.waiting);
    });
  }

  Ready shake_hands(const PlugInTask& task, Eigen::Index samples) {
    return step("handshake", [&] {
      const std::string line = task_line(task, samples, options_.batch);
      return read_ready(child_->exchange(line, {options_.start_s, line_base}));
    });
  }

  Eigen::MatrixXd answer(const PlugInQuestion& question, Samples samples,
                         const Expected& expected) {
    return step(name_of_batch(expected.id, samples), [&] {
      const std::string line = ask_line(batch_of(expected.task, question, samples), expected.id);
      const auto numbers = samples.count * columns(expected.answers, expected.task);
      return read_answer(
          child_->exchange(
              line, {options_.answer_s, line_base + bytes_per_number * std::size_t(numbers)}),
          expected);
    });
  }

  std::string end() {
    step("end", [&] { child_->finish(end_line(), options_.answer_s); });
    return as_utf8(child_->last_words());
  }

 private:
  fs::path plug_in_;
  PlugInOptions options_;
  std::optional<ChildProcess> child_;
};

void check(const PlugInQuestion& question, const PlugInOptions& options) {
  if (question.T_wt.size() != question.commands.size())
    throw std::invalid_argument("expected a pose for every command");
  if (options.batch < 1) throw std::invalid_argument("expected a batch of at least one sample");
}

/// Rows of all batches of a question; `rows(batch, expected)` answers one.
template <typename Rows>
Eigen::MatrixXd in_batches(const PlugInTask& task, const PlugInQuestion& question,
                           const PlugInOptions& options, Answers answers, const Rows& rows) {
  const Eigen::Index samples = Eigen::Index(question.commands.size());
  Eigen::MatrixXd all(samples, columns(answers, task));
  long id = 0;
  for (Samples batch; batch.first < samples; batch.first += batch.count) {
    batch.count = std::min<Eigen::Index>(options.batch, samples - batch.first);
    all.middleRows(batch.first, batch.count) =
        rows(batch, Expected{++id, answers, batch.count, task, options});
  }
  return all;
}

/// @throws ChildFault unless a function answered what is expected
void check(const Eigen::MatrixXd& rows, const Expected& expected) {
  const Eigen::Index wanted = columns(expected.answers, expected.task);
  if (rows.rows() != expected.samples || rows.cols() != wanted)
    throw ChildFault(fmt::format("{} rows of {} numbers", expected.samples, wanted),
                     fmt::format("{} of {}", rows.rows(), rows.cols()));
  for (Eigen::Index i = 0; i < rows.rows(); ++i)
    for (Eigen::Index j = 0; j < wanted; ++j)
      if (const auto instead = expected_instead(rows(i, j), expected, j))
        throw ChildFault(
            *instead, fmt::format("{} in row {}, {}", rows(i, j), i + 1, column_name(expected, j)));
}

}  // namespace

PlugInAnswer ask(const fs::path& plug_in, const PlugInTask& task, const PlugInQuestion& question,
                 const PlugInOptions& options) {
  check(question, options);
  Conversation conversation(plug_in, options);
  const Ready ready = conversation.shake_hands(task, Eigen::Index(question.commands.size()));
  PlugInAnswer answer{as_utf8(ready.name), ready.answers, {}, {}};
  answer.rows = in_batches(task, question, options, ready.answers,
                           [&](Samples batch, const Expected& expected) {
                             return conversation.answer(question, batch, expected);
                           });
  answer.said = conversation.end();
  return answer;
}

PlugInAnswer ask(const std::string& name, const PlugInFunction& function, const PlugInTask& task,
                 const PlugInQuestion& question, const PlugInOptions& options) {
  check(question, options);
  const auto rows = [&](Samples batch, const Expected& expected) {
    if (options.waiting) options.waiting();
    Eigen::MatrixXd answered = function.rows(task, batch_of(task, question, batch));
    try {
      check(answered, expected);
    } catch (const ChildFault& fault) {
      throw PlugInFailure(as_utf8(fmt::format(
          "{}: {}: {}", escaped(name), name_of_batch(expected.id, batch), escaped(fault.what()))));
    }
    return answered;
  };
  return {name, function.answers, in_batches(task, question, options, function.answers, rows), {}};
}

}  // namespace abbe::sim::compensation
