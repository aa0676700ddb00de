#include "sim/dialects/siemens/flow.h"

#include <algorithm>
#include <array>
#include <cmath>

#include <fmt/format.h>

#include "kinematics/bad_input.h"
#include "kinematics/text.h"

namespace abbe::sim::dialects::siemens {

namespace {

constexpr std::array<std::string_view, 27> flow_words = {
    "IF",     "ELSE",  "ENDIF", "FOR",    "ENDFOR",  "WHILE",   "ENDWHILE", "LOOP", "ENDLOOP",
    "REPEAT", "UNTIL", "GOTO",  "GOTOF",  "GOTOB",   "GOTOC",   "GOTOS",    "CASE", "DEF",
    "PROC",   "RET",   "CALL",  "EXTERN", "REPEATB", "ENDPROC", "REDEF",    "SET",  "DEFINE"};

// Keywords that begin and end a structure.
struct Pair {
  std::string_view begins, ends;
};
constexpr Pair pairs[] = {{"IF", "ENDIF"},
                          {"FOR", "ENDFOR"},
                          {"WHILE", "ENDWHILE"},
                          {"LOOP", "ENDLOOP"},
                          {"REPEAT", "UNTIL"}};

bool is_name_char(char c) { return is_letter(c) || is_digit(c) || c == '_'; }

/// Returns true if the line contains GOTO or one of its variants.
bool jumps(std::string_view text) {
  for (std::size_t at = 0; at + 4 <= text.size(); ++at) {
    const bool begins = at == 0 || !is_name_char(text[at - 1]);
    if (begins && upper(text[at]) == 'G' && upper(text[at + 1]) == 'O' &&
        upper(text[at + 2]) == 'T' && upper(text[at + 3]) == 'O')
      return true;
  }
  return false;
}

/// Returns true for a keyword that has an end of its own: IF without a jump in its line, REPEAT
/// without a label.
bool begins_structure(const LineHead& head, std::string_view line) {
  if (head.keyword == "IF") return !jumps(line.substr(head.rest));
  if (head.keyword == "REPEAT")
    return line.find_first_not_of(" \t", head.rest) == std::string_view::npos;
  return std::any_of(std::begin(pairs), std::end(pairs),
                     [&](const Pair& pair) { return pair.begins == head.keyword; });
}

// Matches beginnings and ends once for each program; an end closes the innermost structure of its
// kind.
std::unordered_map<std::size_t, Program::Partner> partners_of(const Program& program) {
  struct Open {
    std::size_t line = 0, otherwise = 0;
    std::string keyword;
    bool has_else = false;
  };
  std::unordered_map<std::size_t, Program::Partner> all;
  std::vector<Open> open;
  for (std::size_t at = 0; at < program.lines.size(); ++at) {
    const std::string_view line = split_comment(program.lines[at]).block;
    const LineHead head = head_of(line);
    if (head.keyword.empty()) continue;
    if (begins_structure(head, line)) {
      open.push_back({at, 0, head.keyword});
    } else if (head.keyword == "ELSE" && !open.empty() && open.back().keyword == "IF") {
      open.back().otherwise = at;
      open.back().has_else = true;
    }
    for (const Pair& pair : pairs) {
      if (pair.ends != head.keyword || open.empty() || open.back().keyword != pair.begins) continue;
      const Open one = open.back();
      open.pop_back();
      all[one.line] = {at, one.otherwise, one.has_else};
      all[at] = {one.line};
      if (one.has_else) all[one.otherwise] = {at};
    }
  }
  return all;
}

}  // namespace

LineHead head_of(std::string_view line) {
  LineHead head;
  std::size_t at = 0;
  const auto skip = [&] {
    while (at < line.size() && is_blank(line[at])) ++at;
  };
  const auto here = [&](std::size_t n = 0) { return at + n < line.size() ? line[at + n] : '\0'; };
  skip();
  if (here() == '/') {
    const bool numbered = is_digit(here(1));
    // A plain / is level 0.
    head.skip_level = numbered ? here(1) - '0' : 0;
    at += numbered ? 2 : 1;
    skip();
  }
  if ((upper(here()) == 'N' || here() == ':') && is_digit(here(1))) {
    const std::size_t digits = ++at;
    while (is_digit(here())) ++at;
    head.number = line.substr(digits, at - digits);
    skip();
  }
  // A line may have one label before its keyword.
  for (int labels = 0; labels < 2; ++labels) {
    head.at = head.rest = at;
    std::size_t end = at;
    while (end < line.size() && is_name_char(line[end])) ++end;
    if (end == at || is_digit(line[at])) return head;
    if (end < line.size() && line[end] == ':' && labels == 0) {
      for (const char c : line.substr(at, end - at)) head.label += upper(c);
      at = end + 1;
      skip();
      continue;
    }
    // Keywords have 2 to 8 letters; anything else is a word or a call.
    if (end - at < 2 || end - at > 8 || !is_letter(line[at + 1])) return head;
    std::string word;
    for (const char c : line.substr(at, end - at)) word += upper(c);
    if (std::find(flow_words.begin(), flow_words.end(), word) != flow_words.end()) {
      head.keyword = std::move(word);
      head.rest = end;
    }
    return head;
  }
  return head;
}

Flow::Flow(std::string_view text, ProgramRun& run)
    : run_(run), variables_(run.options().limits.variables) {
  take_programs(text);
  calls_.push_back({.program = programs_.front().get()});
}

Cursor Flow::cursor_at(std::size_t line) const {
  return {split_comment(calls_.back().program->lines[line]).block, run_.canon.place()};
}

void Flow::run() {
  // The machine must know before the first block whether M6 changes tools.
  run_.try_block([&] { machine_.emplace(run_, uses_m6()); });
  if (!machine_) return;
  run_.run_startup_code([&](std::string_view code) { block({code, run_.canon.place()}); });
  while (!ended_ && !run_.is_aborted()) {
    const Call& now = calls_.back();
    // A repeated part ends at a line, and not at a keyword.
    if (now.part && at_ == now.end) {
      run_.try_block([&] {
        run_.count_block();
        finish_part();
      });
      continue;
    }
    if (at_ >= now.program->lines.size()) {
      if (calls_.size() == 1) break;
      run_.try_block([&] {
        run_.count_block();
        leave();
      });
      continue;
    }
    run_.canon.set_line(now.program->first_line + int(at_), now.program->file);
    const std::size_t before = at_, depth = calls_.size();
    // After an error reading continues at the next line, unless the line itself moved on.
    if (!run_.try_block([&] { ended_ = !line(); }) && at_ == before && calls_.size() == depth) ++at_;
  }
  run_.try_block([&] { machine_->finish(); });
  warn_unread();
}

/// Executes a line. Returns false at the end of the program.
bool Flow::line() {
  run_.count_block();
  const std::string_view whole = calls_.back().program->lines[at_];
  const CommentSplit parts = split_comment(whole);
  // Once, not in every pass of a loop.
  if (parts.comment && calls_.size() == 1 && at_ >= comments_to_) {
    run_.canon.comment(*parts.comment);
    comments_to_ = at_ + 1;
  }
  const LineHead head = head_of(parts.block);
  Cursor cursor{parts.block, run_.canon.place(), head.at};
  if (head.skip_level && run_.skips_block(*head.skip_level)) {
    run_.discount_block();
    ++at_;
    return true;
  }
  if (!head.keyword.empty()) {
    cursor.at = head.rest;
    return keyword(head, cursor);
  }
  ++at_;
  cursor.skip_blanks();
  if (cursor.at_end()) return true;
  return block(cursor);
}

bool Flow::block(Cursor cursor) {
  read_block(cursor, run_, *this, block_);
  const BlockResult done = machine_->execute(block_);
  const std::optional<ProgramCall> called = block_.call;
  // P repeats the call of a subprogram.
  const long long times = block_[Address::P] ? (long long)(block_[Address::P].value) : 1;
  if (block_[Address::P] && !(times >= 1 && times <= 9999))
    run_.canon.refuse(block_[Address::P], "P of 1 to 9999");
  // MCALL alone ends the modal call; with a name it only stores it.
  if (block_.modal) {
    if (called && !Machine::is_cycle(called->name) && find_program(called->name) == nullptr)
      run_.canon.refuse(called->cause, "a cycle or subprogram behind MCALL");
    modal_ = called;
    return true;
  }
  if (done.ends) {
    if (calls_.size() == 1) return false;
    leave();
    return !ended_;
  }
  if (called && !machine_->cycle(*called)) call(*called, times);
  // The modal subprogram does not call itself for its own moves.
  const bool within_modal = modal_depth_ > 0 && calls_.size() >= modal_depth_;
  // A block that calls something else does not trigger the modal call.
  if (done.moved && modal_ && !within_modal && !called) {
    const ProgramCall again = *modal_;
    if (machine_->cycle(again)) return true;
    call(again, 1);
    modal_depth_ = calls_.size();
  }
  return true;
}

void Flow::ends(Cursor& cursor) const {
  cursor.skip_blanks();
  if (!cursor.at_end()) cursor.refuse(cursor.at, "the end of the line");
}

bool Flow::condition(Cursor& cursor) { return number_at(cursor, *this) != 0; }

bool Flow::is_jump(std::string_view word) {
  return word == "GOTO" || word == "GOTOF" || word == "GOTOB" || word == "GOTOC";
}

/// Executes a keyword of program flow. Returns false at the end of the program.
bool Flow::keyword(const LineHead& head, Cursor cursor) {
  const std::string& word = head.keyword;
  const Cause cause = cursor.cause(head.at, head.rest);
  if (word == "IF" || word == "ELSE" || word == "ENDIF") {
    branch(head, cursor);
  } else if (is_jump(word)) {
    jump(cursor, word);
  } else if (word == "CASE") {
    one_of(cursor);
  } else if (word == "DEF") {
    define(cursor);
    ++at_;
  } else if (word == "PROC" || word == "EXTERN" || word == "ENDPROC") {
    // Declarations have been read by `bind`, or have no meaning here.
    ++at_;
  } else if (word == "RET") {
    cursor.skip_blanks();
    if (!cursor.at_end()) cursor.refuse(cursor.at, "RET without parameters");
    if (calls_.size() == 1) return false;
    leave();
    return !ended_;
  } else if (word == "CALL") {
    call_by_name(cursor);
  } else if (word == "REPEATB") {
    repeat(cursor, true);
  } else if (word == "GOTOS" || word == "REDEF" || word == "DEFINE" || word == "SET") {
    run_.canon.refuse(cause, "GOTOB, DEF and single values: no other flow and definitions");
  } else {
    loop(head, cursor);
  }
  return true;
}

const Program::Partner& Flow::partner(const Cursor& cursor, std::size_t at) {
  Program& program = *calls_.back().program;
  if (!program.partners) program.partners = partners_of(program);
  const auto found = program.partners->find(at);
  if (found == program.partners->end()) {
    // The message names the missing counterpart.
    const LineHead head = head_of(cursor.text);
    std::string other = "its beginning";
    for (const Pair& pair : pairs) {
      if (pair.begins == head.keyword) other = std::string(pair.ends) + " behind it";
      if (pair.ends == head.keyword) other = std::string(pair.begins) + " before it";
    }
    if (head.keyword == "ELSE") other = "IF before it and ENDIF behind it";
    cursor.refuse(head.at, other, "none with all between them closed");
  }
  return found->second;
}

void Flow::branch(const LineHead& head, Cursor& cursor) {
  if (head.keyword == "ENDIF") {
    ends(cursor);
    partner(cursor, at_);
    ++at_;
  } else if (head.keyword == "ELSE") {
    ends(cursor);
    at_ = partner(cursor, at_).line + 1;
  } else if (begins_structure(head, cursor.text)) {
    // IF as a structure; otherwise IF with a jump in the same line.
    const Program::Partner other = partner(cursor, at_);
    const bool holds = condition(cursor);
    ends(cursor);
    at_ = holds ? at_ + 1 : (other.has_else ? other.otherwise : other.line) + 1;
  } else {
    const bool holds = condition(cursor);
    cursor.skip_blanks();
    const std::size_t from = cursor.at;
    const std::string how = name_at(cursor);
    if (!is_jump(how)) cursor.refuse(from, "GOTOF, GOTOB or GOTO behind the condition");
    if (holds) return jump(cursor, how);
    ++at_;
  }
}

void Flow::loop(const LineHead& head, Cursor& cursor) {
  const std::string& word = head.keyword;
  if (word == "REPEAT" && !begins_structure(head, cursor.text)) return repeat(cursor, false);
  const std::size_t other = partner(cursor, at_).line;
  if (word == "FOR") {
    count_up(cursor, true);
  } else if (word == "ENDFOR") {
    ends(cursor);
    // The counter is advanced by executing the FOR line again.
    const std::size_t back = at_;
    at_ = other;
    Cursor again = cursor_at(other);
    const LineHead first = head_of(again.text);
    again.at = first.rest;
    try {
      // On an error the line of ENDFOR is the one that failed.
      count_up(again, false);
    } catch (const BadInput&) {
      at_ = back;
      throw;
    }
  } else if (word == "WHILE") {
    const bool holds = condition(cursor);
    ends(cursor);
    at_ = holds ? at_ + 1 : other + 1;
  } else if (word == "ENDWHILE" || word == "ENDLOOP") {
    ends(cursor);
    at_ = other;
  } else if (word == "UNTIL") {
    const bool holds = condition(cursor);
    ends(cursor);
    at_ = holds ? at_ + 1 : other;
  } else {  // LOOP, REPEAT
    ends(cursor);
    ++at_;
  }
}

/// Executes FOR count = first TO last: sets the counter, or adds one to it, and continues behind
/// FOR or ENDFOR.
void Flow::count_up(Cursor& cursor, bool first) {
  cursor.skip_blanks();
  const std::size_t from = cursor.at;
  const std::size_t to = [&] {
    // TO is searched as a word; the text before it is the assignment, the text behind it the limit.
    for (std::size_t at = from; at + 2 < cursor.text.size(); ++at)
      if (is_blank(cursor.text[at]) && upper(cursor.text[at + 1]) == 'T' &&
          upper(cursor.text[at + 2]) == 'O' &&
          (at + 3 == cursor.text.size() || !is_name_char(cursor.text[at + 3])))
        return at;
    cursor.refuse(from, "FOR variable = first TO last");
  }();
  Cursor setting{cursor.text.substr(0, to), cursor.location, from};
  Cursor reading = setting;
  if (first) {
    if (!set_variable(setting)) cursor.refuse(from, "a variable that is defined behind FOR");
    ends(setting);
    reading.at = from;
  }
  const auto counted = parse_operand(reading);
  if (!counted) cursor.refuse(from, "a variable that is defined behind FOR");
  double now = *counted;
  // The counter may be any variable, so it is set by an assignment as text, with all digits.
  if (!first) {
    now += 1.0;
    const std::string text =
        std::string(reading.text.substr(from, reading.at - from)) + fmt::format("={:.17g}", now);
    Cursor next{text, cursor.location};
    set_variable(next);
  }
  Cursor last{cursor.text, cursor.location, to + 3};
  const double limit = number_at(last, *this);
  ends(last);
  at_ = now <= limit ? at_ + 1 : partner(cursor, at_).line + 1;
}

void Flow::jump(Cursor& cursor, const std::string& how) {
  cursor.skip_blanks();
  const std::size_t from = cursor.at;
  std::string label;
  while (is_name_char(cursor.current())) label += upper(cursor.text[cursor.at++]);
  if (label.empty()) cursor.refuse(from, "a label or a line number behind " + how);
  const Cause cause = cursor.cause(from);
  ends(cursor);
  at_ = line_of(label, how, cause);
}

std::size_t Flow::line_of(const std::string& label, const std::string& how, const Cause& cause) {
  Program& program = *calls_.back().program;
  // Labels are collected once for each program; one label may occur several times.
  if (!program.labels) {
    program.labels.emplace();
    for (std::size_t at = 0; at < program.lines.size(); ++at) {
      const LineHead head = head_of(split_comment(program.lines[at]).block);
      if (!head.label.empty()) (*program.labels)[head.label].push_back(at);
      if (!head.number.empty()) (*program.labels)["N" + std::string(head.number)].push_back(at);
    }
  }
  const auto found = program.labels->find(label);
  if (found != program.labels->end()) {
    const std::vector<std::size_t>& lines = found->second;
    // GOTOF searches forwards, GOTOB backwards; GOTO forwards first, then from the beginning.
    const auto behind = std::upper_bound(lines.begin(), lines.end(), at_);
    const bool forwards = how == "GOTOF", backwards = how == "GOTOB";
    if (!backwards && behind != lines.end()) return *behind;
    if (backwards && behind != lines.begin()) return *(behind - 1);
    if (!forwards && !backwards) return lines.front();
  }
  // GOTOC ignores a missing label.
  if (how == "GOTOC") return at_ + 1;
  run_.refuse_once(how + " " + label, cause,
                   how == "GOTOF"   ? "a label in the lines that follow"
                   : how == "GOTOB" ? "a label in the lines before"
                                    : "a label of this program");
}

/// Example: CASE value OF 1 GOTOF A 2 GOTOB B DEFAULT GOTOF C.
void Flow::one_of(Cursor& cursor) {
  const double chosen = number_at(cursor, *this);
  if (!cursor.accept_word("OF")) cursor.refuse(cursor.at, "OF behind the value of CASE");
  bool is_default = false;
  while (true) {
    cursor.skip_blanks();
    if (cursor.at_end()) break;
    is_default = cursor.accept_word("DEFAULT");
    const bool taken = is_default || number_at(cursor, *this) == chosen;
    cursor.skip_blanks();
    const std::size_t from = cursor.at;
    const std::string how = name_at(cursor);
    if (!is_jump(how)) cursor.refuse(from, "GOTOF, GOTOB or GOTO behind a value of CASE");
    cursor.skip_blanks();
    const std::size_t at_label = cursor.at;
    while (is_name_char(cursor.current())) ++cursor.at;
    if (!taken) continue;
    Cursor target{cursor.text.substr(0, cursor.at), cursor.location, at_label};
    return jump(target, how);
  }
  ++at_;
}

}  // namespace abbe::sim::dialects::siemens
