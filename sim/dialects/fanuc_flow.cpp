#include "sim/dialects/fanuc_flow.h"

#include <algorithm>
#include <cmath>

#include <fmt/format.h>

#include "kinematics/bad_input.h"
#include "kinematics/text.h"
#include "kinematics/units.h"

namespace abbe::sim::dialects::fanuc {

namespace {

constexpr int last_local = 33;

bool is_common(int number) {
  return (number >= 100 && number <= 199) || (number >= 500 && number <= 999);
}

}  // namespace

Flow::Flow(std::string_view text, ProgramRun& run)
    : run_(run), machine_(run), variables_(run.options().limits.variables) {
  auto main = std::make_unique<Source>();
  main->lines = lines_of_text(text);
  sources_.push_back(std::move(main));
  add_programs(0);
  calls_.push_back({.program = &sources_[0]->programs.front()});
}

void Flow::run() {
  run_.start([&](std::string_view code) { block({code, run_.canon.place()}); });
  while (!ended_ && !run_.hopeless()) {
    if (at_ >= calls_.back().program->end) {
      if (calls_.size() == 1) break;
      run_.attempt([&] { end_of_program(); });
      continue;
    }
    run_.canon.stand_at(int(at_) + 1, source().file);
    const std::size_t before = at_, depth = calls_.size();
    if (!run_.attempt([&] { ended_ = !line(); }) && at_ == before && calls_.size() == depth) ++at_;
  }
  run_.attempt([&] { machine_.finish(); });
  warn_unread();
}

/// @return false at the end of the program
bool Flow::line() {
  run_.count_block();
  const std::string_view text = source().lines[at_];
  Cursor cursor{text, run_.canon.place()};
  cursor.skip_blanks();
  if (cursor.here() == '/') {
    if (run_.skips(skip_level(cursor))) {
      run_.discount_block();
      ++at_;
      return true;
    }
  }
  block_.comments.clear();
  pass_comments(cursor, block_.comments);
  const char first = upper(cursor.here());
  int sequence = -1;
  if ((first == 'O' || first == ':') && is_digit(cursor.next())) {
    ++cursor.at;
    cursor.number(false);
    cursor.skip_blanks();
  }
  if (upper(cursor.here()) == 'N') {
    const std::size_t from = cursor.at++;
    const auto number = cursor.number(false);
    if (!number) cursor.refuse(from, "a sequence number after N");
    sequence = int(std::min(*number, 99'999'999.0));
  }
  machine_.note_numbers(sequence, calls_.back().program->number);
  pass_comments(cursor, block_.comments);
  if (statement(cursor)) return true;
  ++at_;
  return block(cursor);
}

/// A statement of custom macro B. @return false where none begins there
bool Flow::statement(Cursor& cursor) {
  const std::size_t from = cursor.at;
  resolution = 1.0;
  const auto word_and = [&](std::string_view word, auto follows) {
    if (cursor.take(word) && (cursor.skip_blanks(), follows(cursor.here()))) return true;
    cursor.at = from;
    return false;
  };
  const auto bracket = [](char c) { return c == '['; };
  const auto number = [](char c) { return is_digit(c) || c == '#' || c == '['; };
  if (cursor.here() == '#') {
    ++at_;
    assign(cursor);
  } else if (word_and("IF", bracket)) {
    branch(cursor);
  } else if (word_and("GOTO", number)) {
    const int target = whole_value(cursor, 99'999'999, "a sequence number");
    ends(cursor);
    jump(target, cursor.cause(from));
  } else if (word_and("WHILE", bracket)) {
    begin_loop(cursor, from, true);
  } else if (word_and("DO", is_digit)) {
    begin_loop(cursor, from, false);
  } else if (word_and("END", is_digit)) {
    end_loop(cursor, from);
  } else if (cursor.take("ELSE") || cursor.take("ENDIF")) {
    cursor.refuse(from, std::string(sentence_of("ELSE")));
  } else if (cursor.take("SETVN")) {
    cursor.refuse(from, std::string(sentence_of("SETVN")));
  } else if (cursor.take("POPEN") || cursor.take("PCLOS") || cursor.take("DPRNT") ||
             cursor.take("BPRNT")) {
    ++at_;
  } else {
    return false;
  }
  return true;
}

bool Flow::block(Cursor cursor) {
  std::vector<std::string_view> before = std::move(block_.comments);
  read_block(cursor, run_, *this, block_);
  block_.comments.insert(block_.comments.begin(), before.begin(), before.end());
  if (block_.percent && has_words(cursor.text))
    run_.warn_once(fmt::format("{}:{}: {} on the line of % is not read", run_.canon.place().file,
                               run_.canon.line(), in_quotes(cursor.text)));
  if (block_.percent || block_.empty()) {
    for (const std::string_view text : block_.comments) run_.canon.comment(text);
    return true;
  }
  const Code& macro = block_[Group::Macro];
  if (macro.tenths == 650 || macro.tenths == 660) {
    call_macro();
    return true;
  }
  if (macro.tenths == 670) modal_.reset();
  if (!machine_.execute(block_)) return false;
  if (block_[Group::Call]) {
    call_subprogram();
    return !ended_;
  }
  const bool within =
      std::any_of(calls_.begin(), calls_.end(), [](const Call& c) { return c.modal; });
  if (modal_ && machine_.moved() && !within)
    enter(find_program(modal_->program, modal_->cause),
          {.back = at_,
           .left = modal_->repeats - 1,
           .macro = true,
           .modal = true,
           .arguments = modal_->arguments},
          modal_->cause);
  return true;
}

/// Nothing but a comment follows.
void Flow::ends(Cursor& cursor) {
  std::vector<std::string_view> comments;
  pass_comments(cursor, comments);
  if (cursor.here() == ';') ++cursor.at;
  pass_comments(cursor, comments);
  if (!cursor.at_end()) cursor.refuse(cursor.at, "nothing more in a block of a macro statement");
}

int Flow::whole_value(Cursor& cursor, int most, std::string_view what) {
  const std::size_t from = cursor.at;
  const double found = value(cursor, grammar(), *this);
  const double near = is_vacant(found) ? -1.0 : std::round(found);
  if (near < 0 || near > most) cursor.refuse(from, fmt::format("{} of 0 to {}", what, most));
  return int(near);
}

/// #n or #[...], the number of a variable.
int Flow::variable_number(Cursor& cursor) {
  const std::size_t from = cursor.at++;
  if (cursor.here() == '_' || cursor.here() == '<' ||
      (cursor.here() == '[' && cursor.next() == '#' && cursor.next(2) == '_'))
    cursor.refuse(from, "a variable by its number: names of variables are not read");
  if (cursor.here() != '[' && !is_digit(cursor.here()))
    cursor.refuse(from, "a number, or [ ], after #");
  const double number =
      cursor.here() == '[' ? bracketed(cursor, grammar(), *this) : *cursor.number(false);
  const double near = is_vacant(number) ? 0.0 : std::round(number);
  if (near < 0 || near > 99999) cursor.refuse(from, "a variable of #0 to #99999");
  return int(near);
}

double Flow::read(int number, const Cursor& cursor, std::size_t from) {
  if (number == 0) return vacant;
  if (run_.in_doubt()) run_.require_certain(fmt::format("#{}", number), cursor.cause(from));
  if (number <= last_local) return variables_.number(number, Variables::Of::Call).value_or(vacant);
  if (is_common(number)) return variables_.number(number).value_or(vacant);
  if (const auto system = machine_.variable(number)) return *system;
  cursor.refuse(from,
                "a variable of #1 to #33, #100 to #199, #500 to #999, or of the system that "
                "the table of words names",
                fmt::format("#{}", number));
}

double Flow::variable(Cursor& cursor) {
  const std::size_t from = cursor.at;
  return read(variable_number(cursor), cursor, from);
}

void Flow::set(int number, double value, const Cursor& cursor, std::size_t from) {
  if (number == 3000) alarm(cursor, value);
  const bool local = number >= 1 && number <= last_local;
  if (!local && !is_common(number)) {
    if (number == 0 || !machine_.set_variable(number, is_vacant(value) ? 0.0 : value))
      cursor.refuse(from, "a variable that can be set", fmt::format("#{}", number));
    return;
  }
  const Variables::Of of = local ? Variables::Of::Call : Variables::Of::Program;
  if (is_vacant(value)) return variables_.unset(number, of);
  if (!variables_.set(number, value, of))
    throw Exhausted(cursor.place.file, cursor.place.line, 0,
                    fmt::format("at most {} variables", run_.options().limits.variables), "more");
}

/// #3000 stops the control with what the program says.
void Flow::alarm(const Cursor& cursor, double number) {
  const std::size_t open = cursor.text.find('(', cursor.at);
  const std::size_t close = cursor.text.find(')', cursor.at);
  const std::string text = open != std::string_view::npos && close > open
                               ? " " + shown(cursor.text.substr(open + 1, close - open - 1))
                               : "";
  cursor.refuse(0, "no alarm of the program", fmt::format("#3000 = {:g}{}", number, text));
}

void Flow::assign(Cursor& cursor) {
  const std::size_t from = cursor.at;
  const int number = variable_number(cursor);
  run_.define(fmt::format("#{}", number), [&] {
    if (!cursor.take("=")) cursor.refuse(cursor.at, "= after a variable that begins a block");
    const double result = expression(cursor, grammar(), *this);
    set(number, result, cursor, from);
    ends(cursor);
  });
}

std::optional<double> Flow::operand(Cursor& cursor) {
  if (cursor.here() == '#') return variable(cursor);
  const std::size_t from = cursor.at;
  const auto plain = [](double x) { return is_vacant(x) ? 0.0 : x; };
  if (cursor.take("ROUND")) {
    const double step = resolution;
    const double x = plain(bracketed(cursor, grammar(), *this));
    return std::round(x / step) * step;
  }
  if (cursor.take("ATAN")) {
    const double y = plain(bracketed(cursor, grammar(), *this));
    if (!cursor.take("/")) return std::atan(y) / units::deg;
    const double x = plain(bracketed(cursor, grammar(), *this));
    const double angle = std::atan2(y, x) / units::deg;
    return angle < 0 ? angle + 360.0 : angle;
  }
  if (cursor.take("POW")) {
    if (!cursor.take("[")) cursor.refuse(cursor.at, "[base, exponent] after POW");
    const double base = plain(expression(cursor, grammar(), *this));
    if (!cursor.take(",")) cursor.refuse(cursor.at, ", between base and exponent");
    const double power = std::pow(base, plain(expression(cursor, grammar(), *this)));
    if (!cursor.take("]")) cursor.refuse(cursor.at, "] after POW");
    if (!std::isfinite(power)) cursor.refuse(from, "a result that is a finite number");
    return power;
  }
  for (const std::string_view word : {"BIN", "BCD", "ADP"})
    if (cursor.take(word)) cursor.refuse(from, std::string(sentence_of(word)));
  return std::nullopt;
}

}  // namespace abbe::sim::dialects::fanuc
