#pragma once

#include "sim/dialects/control.h"

namespace abbe::sim::dialects {

/// A text of a program: the program itself, or a file of subprograms.
struct Source {
  std::string text;  ///< of a file of subprograms; empty for the program itself
  std::vector<std::string_view> lines;
  int first_line = 1, file = 0;  ///< as the canon numbers them
};

/// Flow of a program: its texts, variables and calls. A dialect executes its lines, and derives its
/// texts from `Source`.
template <typename Text, typename Call, typename Operands = OperandParser>
class ProgramFlow : public Operands {
 protected:
  explicit ProgramFlow(ProgramRun& run) : run_(run), variables_(run.options().limits.variables) {}

  /// Returns the text that runs.
  virtual const Source& source() const = 0;
  /// Executes the current line. Returns false at the end of the program.
  virtual bool execute_line() = 0;
  /// Executes a block. Returns false at the end of the program.
  virtual bool execute_block(Cursor block) = 0;
  /// Returns true if no line of the running call is left.
  virtual bool is_call_at_end() const { return line_index_ >= source().lines.size(); }
  /// Ends a call of which no line is left.
  virtual void end_call() = 0;
  virtual bool has_ended() const { return has_ended_; }

  [[noreturn]] void throw_input_error(const Cause& cause, std::string expected,
                                      std::optional<std::string> seen = {}) const {
    run_.canon.throw_input_error(cause, std::move(expected), std::move(seen));
  }

  /// Adds the text of the program itself.
  Text& add_source(std::string_view text) {
    sources_.push_back(std::make_unique<Text>());
    sources_.back()->lines = lines_of_text(text);
    return *sources_.back();
  }
  /// Adds a file of subprograms, which messages call `name`. Throws BadInput with `limit` for more
  /// than 1000 files.
  Text& add_source_file(const std::filesystem::path& file, const std::string& name,
                        const char* limit = "at most 1000 files of subprograms") {
    // Bound memory for a folder of generated programs.
    constexpr std::size_t max_sources = 1000, max_file_bytes = std::size_t(1) << 26;
    if (sources_.size() == max_sources) throw_input_error({1, {}}, limit, "more");
    auto source = std::make_unique<Text>();
    source->text = read_text(file, max_file_bytes);
    source->lines = lines_of_text(source->text);
    source->file = run_.canon.add_file(name);
    sources_.push_back(std::move(source));
    return *sources_.back();
  }

  /// Executes the startup code, then lines until the program ends.
  void run_lines() {
    run_.run_startup_code([&](std::string_view code) {
      execute_block({code, run_.canon.place()});
    });
    while (!has_ended() && !run_.is_aborted()) {
      if (is_call_at_end()) {
        // The end of the text ends the main program.
        if (calls_.size() == 1) break;
        run_.try_block([&] { end_call(); });
        continue;
      }
      run_.canon.set_line(source().first_line + int(line_index_), source().file);
      const std::size_t line_before = line_index_, depth_before = calls_.size();
      // After an error reading continues at the next line, unless the statement itself has moved
      // on.
      if (!run_.try_block([&] { has_ended_ = !execute_line(); }) && line_index_ == line_before &&
          calls_.size() == depth_before)
        ++line_index_;
    }
  }

  ProgramRun& run_;
  Variables variables_;
  std::vector<std::unique_ptr<Text>> sources_;  ///< the first one is the program itself
  std::vector<Call> calls_;                     ///< the last one is running
  std::size_t line_index_ = 0;                  ///< current line of the running text, from 0
  bool has_ended_ = false;
};

}  // namespace abbe::sim::dialects
