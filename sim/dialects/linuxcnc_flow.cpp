#include "sim/dialects/linuxcnc_flow.h"

#include <algorithm>
#include <cmath>

#include <fmt/format.h>

#include "kinematics/bad_input.h"
#include "kinematics/text.h"
#include "kinematics/units.h"

namespace abbe::sim::dialects::linuxcnc {

Flow::Flow(std::string_view text, ProgramRun& run)
    : run_(run), machine_(run), variables_(run.options().limits.variables) {
  auto main = std::make_unique<Source>();
  main->lines = lines_of_text(text);
  sources_.push_back(std::move(main));
  calls_.push_back({.source = sources_.front().get()});
}

Cursor Flow::cursor_at(const Source& source, std::size_t line) const {
  return {source.lines[line], run_.canon.place()};
}

void Flow::run() {
  run_.start([&](std::string_view code) { block({code, run_.canon.place()}); });
  while (!ended_ && !run_.hopeless()) {
    const Call& now = calls_.back();
    if (at_ >= now.source->lines.size()) {
      if (calls_.size() == 1) break;
      run_.attempt([&] { end_of_file(); });
      continue;
    }
    run_.canon.stand_at(int(at_) + 1, now.source->file);
    const std::size_t before = at_;
    if (!run_.attempt([&] { ended_ = !line(); }) && at_ == before) ++at_;
  }
  run_.attempt([&] { machine_.finish(); });
  const std::vector<std::string_view>& lines = sources_.front()->lines;
  run_.warn_unread(lines, {{0, lines.size()}});
}

/// @return false at the end of the program
bool Flow::line() {
  run_.count_block();
  const std::string_view text = calls_.back().source->lines[at_];
  Cursor cursor{text, run_.canon.place()};
  if (text.find_first_of("oO") != std::string_view::npos)
    if (const auto o = o_word(cursor)) {
      if (text[text.find_first_not_of(" \t")] == '/') run_.skips(0);
      o_line(*o, cursor);
      return true;
    }
  ++at_;
  return block({text, run_.canon.place()});
}

bool Flow::block(Cursor cursor) {
  try {
    read_block(cursor, run_, *this, block_);
  } catch (const BadInput&) {  // nothing of the block is set
    for (const auto& [number, value] : block_.numbers) run_.doubt(fmt::format("#{}", number));
    for (const auto& [name, value] : block_.names) run_.doubt(fmt::format("#<{}>", name));
    throw;
  }
  if (block_.percent && calls_.size() == 1 && ++percents_ == 2) return false;
  if (block_.percent) return true;
  if (block_.deleted && run_.skips(0)) {
    run_.discount_block();
    return true;
  }
  if (!block_.numbers.empty() || !block_.names.empty()) set(block_, cursor);
  if (block_.empty()) {
    for (const std::string_view text : block_.comments) run_.canon.comment(text);
    return true;
  }
  if (block_[Group::State]) return keep_modes(), true;
  return machine_.execute(block_);
}

/// M70 to M73: every call has a state of its own.
void Flow::keep_modes() {
  const Code& code = block_[Group::State];
  bool alone = block_.words.empty();
  for (const Code& other : block_.codes) alone = alone && (!other || &other == &code);
  if (!alone) run_.canon.refuse(code.word, "a block of its own for " + shown(code.word.text));
  Call& now = calls_.back();
  if (code.tenths == 700 || code.tenths == 730) now.saved = machine_.modes();
  if (code.tenths == 730) now.restores = true;
  if (code.tenths == 710) now.saved.reset();
  if (code.tenths != 720) return;
  if (!now.saved) run_.canon.refuse(code.word, "M70 or M73 before M72", "none");
  machine_.restore(*now.saved, code.word);
}

void Flow::set(const Block& block, const Cursor& cursor) {
  const auto too_many = [&] {
    throw Exhausted(cursor.place.file, cursor.place.line, 0,
                    fmt::format("at most {} parameters", run_.options().limits.variables), "more");
  };
  for (const auto& [number, value] : block.numbers) {
    if (number < 1) cursor.refuse(0, "a parameter of #1 to #5601", fmt::format("#{}", number));
    if (number <= 30)
      calls_.back().locals[std::size_t(number)] = value;
    else if (!machine_.set_parameter(number, value))
      cursor.refuse(0, "a parameter that can be set", fmt::format("#{}", number));
  }
  for (const auto& [name, value] : block.names) {
    const bool global = name.front() == '_';
    if (global && machine_.named(name))
      cursor.refuse(0, "a parameter that can be set", "#<" + name + ">");
    if (!variables_.set(name, value, global ? Variables::Of::Program : Variables::Of::Call))
      too_many();
  }
}

double Flow::named(const std::string& name, const Cursor& cursor, std::size_t from) {
  if (run_.in_doubt()) run_.require_certain(fmt::format("#<{}>", name), cursor.cause(from));
  const bool global = name.front() == '_';
  if (const auto own =
          variables_.named(name, global ? Variables::Of::Program : Variables::Of::Call))
    return *own;
  if (global) {
    if (name == "_call_level") return double(calls_.size() - 1);
    if (const auto system = machine_.named(name)) return *system;
  }
  cursor.refuse(from, "a named parameter that has been set", "#<" + name + ">");
}

bool Flow::exists(const std::string& name) const {
  const bool global = name.front() == '_';
  return variables_.named(name, global ? Variables::Of::Program : Variables::Of::Call) ||
         (global && machine_.named(name));
}

/// #n, ##n, #[...], #<name>
double Flow::parameter(Cursor& cursor) {
  const std::size_t from = cursor.at++;
  cursor.skip_blanks();
  if (cursor.here() == '<') return named(name_in_brackets(cursor), cursor, from);
  const int number = whole(cursor, from, value(cursor, grammar(), *this), 5601);
  if (number < 1) cursor.refuse(from, "a parameter of #1 to #5601", fmt::format("#{}", number));
  if (run_.in_doubt()) run_.require_certain(fmt::format("#{}", number), cursor.cause(from));
  return number <= 30 ? calls_.back().locals[std::size_t(number)] : machine_.parameter(number);
}

std::optional<double> Flow::operand(Cursor& cursor) {
  if (cursor.here() == '#') return parameter(cursor);
  const std::size_t from = cursor.at;
  if (cursor.take("ATAN")) {
    const double y = bracketed(cursor, grammar(), *this);
    if (!cursor.take("/")) cursor.refuse(cursor.at, "/ after the first argument of ATAN");
    const double x = bracketed(cursor, grammar(), *this);
    return std::atan2(y, x) / units::deg;
  }
  if (cursor.take("EXISTS")) {
    if (!cursor.take("[") || !cursor.take("#") || (cursor.skip_blanks(), cursor.here() != '<'))
      cursor.refuse(from, "[#<name>] after EXISTS");
    const bool is = exists(name_in_brackets(cursor));
    if (!cursor.take("]")) cursor.refuse(cursor.at, "] after EXISTS");
    return is ? 1.0 : 0.0;
  }
  return std::nullopt;
}

}  // namespace abbe::sim::dialects::linuxcnc
