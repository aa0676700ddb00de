#include "sim/dialects/read_program.h"
#include "sim/dialects/siemens/siemens.h"

namespace abbe::sim::dialects::siemens {

namespace {

constexpr std::array<std::string_view, 27> flow_keywords = {
    "IF",     "ELSE",  "ENDIF", "FOR",    "ENDFOR",  "WHILE",   "ENDWHILE", "LOOP", "ENDLOOP",
    "REPEAT", "UNTIL", "GOTO",  "GOTOF",  "GOTOB",   "GOTOC",   "GOTOS",    "CASE", "DEF",
    "PROC",   "RET",   "CALL",  "EXTERN", "REPEATB", "ENDPROC", "REDEF",    "SET",  "DEFINE"};

// Keywords that begin and end a structure.
struct KeywordPair {
  std::string_view begins, ends;
};
constexpr KeywordPair keyword_pairs[] = {{"IF", "ENDIF"},
                                         {"FOR", "ENDFOR"},
                                         {"WHILE", "ENDWHILE"},
                                         {"LOOP", "ENDLOOP"},
                                         {"REPEAT", "UNTIL"}};

/// Returns true if the line contains GOTO or one of its variants.
bool has_jump(std::string_view text) {
  for (std::size_t at = 0; at + 4 <= text.size(); ++at) {
    const bool begins_word = at == 0 || !is_name_char(text[at - 1]);
    if (begins_word && upper(text[at]) == 'G' && upper(text[at + 1]) == 'O' &&
        upper(text[at + 2]) == 'T' && upper(text[at + 3]) == 'O')
      return true;
  }
  return false;
}

/// Returns true if a keyword begins a structure that has an end keyword: IF without a jump in its
/// line, REPEAT without a label, and the other loops.
bool begins_structure(const LineHead& head, std::string_view line) {
  if (head.keyword == "IF") return !has_jump(line.substr(head.end));
  if (head.keyword == "REPEAT")
    return line.find_first_not_of(" \t", head.end) == std::string_view::npos;
  return std::any_of(std::begin(keyword_pairs), std::end(keyword_pairs),
                     [&](const KeywordPair& pair) { return pair.begins == head.keyword; });
}

// Returns the counterparts of all structures. An end keyword closes the innermost open structure
// only if it matches its beginning.
std::unordered_map<std::size_t, Program::Counterpart> match_structures(const Program& program) {
  struct OpenStructure {
    std::size_t line = 0, else_line = 0;
    std::string keyword;
    bool has_else = false;
  };
  std::unordered_map<std::size_t, Program::Counterpart> counterparts;
  std::vector<OpenStructure> open;
  for (std::size_t line_index = 0; line_index < program.lines.size(); ++line_index) {
    const std::string_view line = split_comment(program.lines[line_index]).block;
    const LineHead head = parse_line_head(line);
    if (head.keyword.empty()) continue;
    if (begins_structure(head, line)) {
      open.push_back({line_index, 0, head.keyword});
    } else if (head.keyword == "ELSE" && !open.empty() && open.back().keyword == "IF") {
      open.back().else_line = line_index;
      open.back().has_else = true;
    }
    for (const KeywordPair& pair : keyword_pairs) {
      if (pair.ends != head.keyword || open.empty() || open.back().keyword != pair.begins) continue;
      const OpenStructure structure = open.back();
      open.pop_back();
      counterparts[structure.line] = {line_index, structure.else_line, structure.has_else};
      counterparts[line_index] = {structure.line};
      if (structure.has_else) counterparts[structure.else_line] = {line_index};
    }
  }
  return counterparts;
}

}  // namespace

LineHead parse_line_head(std::string_view line) {
  LineHead head;
  std::size_t at = 0;
  const auto skip = [&] {
    while (at < line.size() && is_blank(line[at])) ++at;
  };
  const auto peek = [&](std::size_t n = 0) { return at + n < line.size() ? line[at + n] : '\0'; };
  skip();
  if (peek() == '/') {
    // A slash without a number is level 0.
    const bool has_level = is_digit(peek(1));
    head.skip_level = has_level ? peek(1) - '0' : 0;
    at += has_level ? 2 : 1;
    skip();
  }
  if ((upper(peek()) == 'N' || peek() == ':') && is_digit(peek(1))) {
    const std::size_t digits = ++at;
    while (is_digit(peek())) ++at;
    head.number = line.substr(digits, at - digits);
    skip();
  }
  // A line may have one label before its keyword.
  for (int label_count = 0; label_count < 2; ++label_count) {
    head.at = head.end = at;
    std::size_t end = at;
    while (end < line.size() && is_name_char(line[end])) ++end;
    if (end == at || is_digit(line[at])) return head;
    if (end < line.size() && line[end] == ':' && label_count == 0) {
      for (const char c : line.substr(at, end - at)) head.label += upper(c);
      at = end + 1;
      skip();
      continue;
    }
    // Keywords have 2 to 8 letters; every other name is a word or a call.
    if (end - at < 2 || end - at > 8 || !is_letter(line[at + 1])) return head;
    std::string word;
    for (const char c : line.substr(at, end - at)) word += upper(c);
    if (std::find(flow_keywords.begin(), flow_keywords.end(), word) != flow_keywords.end()) {
      head.keyword = std::move(word);
      head.end = end;
    }
    return head;
  }
  return head;
}

Cursor Flow::cursor_of_line(std::size_t line) const {
  return {split_comment(calls_.back().program->lines[line]).block, run_.canon.place()};
}

void Flow::run() {
  // The machine must know before the first block whether M6 changes tools.
  run_.try_block([&] { machine_.emplace(run_, uses_m6()); });
  if (!machine_) return;
  run_lines();
  run_.try_block([&] { machine_->finish(); });
  warn_unread();
}

void Flow::end_call() {
  run_.count_block();
  // A repeated section ends at a line, not at a keyword.
  if (is_section_at_end())
    finish_repeated_section();
  else
    leave_program();
}

/// Executes a line. Returns false at the end of the program.
bool Flow::execute_line() {
  run_.count_block();
  const CommentSplit parts = split_comment(calls_.back().program->lines[line_index_]);
  // A comment is recorded once, not in every pass of a loop.
  if (parts.comment && calls_.size() == 1 && line_index_ >= first_unrecorded_comment_) {
    run_.canon.comment(*parts.comment);
    first_unrecorded_comment_ = line_index_ + 1;
  }
  const LineHead head = parse_line_head(parts.block);
  Cursor cursor{parts.block, run_.canon.place(), head.at};
  if (head.skip_level && run_.skips_block(*head.skip_level)) {
    run_.discount_block();
    ++line_index_;
    return true;
  }
  if (!head.keyword.empty()) {
    cursor.at = head.end;
    return execute_keyword(head, cursor);
  }
  ++line_index_;
  cursor.skip_blanks();
  if (cursor.at_end()) return true;
  return execute_block(cursor);
}

bool Flow::execute_block(Cursor cursor) {
  read_block(cursor, run_, *this, block_);
  const BlockResult result = machine_->execute(block_);
  const std::optional<ProgramCall> program_call = block_.call;
  // P repeats the call of a subprogram.
  const long long count = block_["P"] ? (long long)(block_["P"].value) : 1;
  if (block_["P"] && !(count >= 1 && count <= 9999))
    throw_input_error(block_["P"], "P from 1 to 9999");
  // MCALL with a name stores the modal call; MCALL alone ends it.
  if (block_.is_modal) {
    if (program_call && !Machine::is_cycle(program_call->name) &&
        find_program(program_call->name) == nullptr)
      throw_input_error(program_call->cause, "a cycle or subprogram after MCALL");
    modal_call_ = program_call;
    return true;
  }
  if (result.is_program_end) {
    if (calls_.size() == 1) return false;
    leave_program();
    return !has_ended_;
  }
  if (program_call && !machine_->execute_cycle(*program_call)) call_program(*program_call, count);
  // The modal subprogram does not call itself for its own moves.
  const bool is_inside_modal_call = modal_depth_ > 0 && calls_.size() >= modal_depth_;
  // A block with a call of its own does not trigger the modal call.
  if (result.has_moved && modal_call_ && !is_inside_modal_call && !program_call) {
    const ProgramCall modal_call = *modal_call_;
    if (machine_->execute_cycle(modal_call)) return true;
    call_program(modal_call, 1);
    modal_depth_ = calls_.size();
  }
  return true;
}

void Flow::expect_end(Cursor& cursor) const {
  cursor.skip_blanks();
  if (!cursor.at_end()) cursor.throw_input_error(cursor.at, "the end of the line");
}

bool Flow::evaluate_condition(Cursor& cursor) { return parse_number(cursor, *this) != 0; }

bool Flow::is_jump(std::string_view word) {
  return word == "GOTO" || word == "GOTOF" || word == "GOTOB" || word == "GOTOC";
}

/// Executes a keyword of program flow. Returns false at the end of the program.
bool Flow::execute_keyword(const LineHead& head, Cursor cursor) {
  const std::string& word = head.keyword;
  const Cause cause = cursor.cause(head.at, head.end);
  if (word == "IF" || word == "ELSE" || word == "ENDIF") {
    execute_if(head, cursor);
  } else if (is_jump(word)) {
    execute_jump(cursor, word);
  } else if (word == "CASE") {
    execute_case(cursor);
  } else if (word == "DEF") {
    execute_definition(cursor);
    ++line_index_;
  } else if (word == "PROC" || word == "EXTERN" || word == "ENDPROC") {
    // `bind_parameters` has read the declarations; EXTERN and ENDPROC have no meaning here.
    ++line_index_;
  } else if (word == "RET") {
    cursor.skip_blanks();
    if (!cursor.at_end()) cursor.throw_input_error(cursor.at, "RET without parameters");
    if (calls_.size() == 1) return false;
    leave_program();
    return !has_ended_;
  } else if (word == "CALL") {
    call_by_name(cursor);
  } else if (word == "REPEATB") {
    repeat_section(cursor, true);
  } else if (word == "GOTOS" || word == "REDEF" || word == "DEFINE" || word == "SET") {
    throw_input_error(
        cause, "GOTOB, DEF and single values: other flow words and definitions are not supported");
  } else {
    execute_loop(head, cursor);
  }
  return true;
}

const Program::Counterpart& Flow::counterpart(const Cursor& cursor, std::size_t at) {
  Program& program = *calls_.back().program;
  if (!program.counterparts) program.counterparts = match_structures(program);
  const auto entry = program.counterparts->find(at);
  if (entry == program.counterparts->end()) {
    // The message names the missing counterpart.
    const LineHead head = parse_line_head(cursor.text);
    std::string expected = "its start";
    for (const KeywordPair& pair : keyword_pairs) {
      if (pair.begins == head.keyword) expected = std::string(pair.ends) + " after it";
      if (pair.ends == head.keyword) expected = std::string(pair.begins) + " before it";
    }
    if (head.keyword == "ELSE") expected = "IF before it and ENDIF after it";
    cursor.throw_input_error(head.at, expected, "none with every block between them closed");
  }
  return entry->second;
}

void Flow::execute_if(const LineHead& head, Cursor& cursor) {
  if (head.keyword == "ENDIF") {
    expect_end(cursor);
    counterpart(cursor, line_index_);
    ++line_index_;
  } else if (head.keyword == "ELSE") {
    expect_end(cursor);
    line_index_ = counterpart(cursor, line_index_).line + 1;
  } else if (begins_structure(head, cursor.text)) {
    const Program::Counterpart end = counterpart(cursor, line_index_);
    const bool is_true = evaluate_condition(cursor);
    expect_end(cursor);
    line_index_ = is_true ? line_index_ + 1 : (end.has_else ? end.else_line : end.line) + 1;
  } else {
    // IF with a jump in the same line.
    const bool is_true = evaluate_condition(cursor);
    const std::size_t from = skip_blanks(cursor);
    const std::string keyword = parse_name(cursor);
    if (!is_jump(keyword))
      cursor.throw_input_error(from, "GOTOF, GOTOB or GOTO after the condition");
    if (is_true) return execute_jump(cursor, keyword);
    ++line_index_;
  }
}

void Flow::execute_loop(const LineHead& head, Cursor& cursor) {
  const std::string& word = head.keyword;
  if (word == "REPEAT" && !begins_structure(head, cursor.text))
    return repeat_section(cursor, false);
  const std::size_t other_end = counterpart(cursor, line_index_).line;
  if (word == "FOR") {
    execute_for(cursor, true);
  } else if (word == "ENDFOR") {
    expect_end(cursor);
    // The counter is advanced by executing the FOR line again.
    const std::size_t endfor_line = line_index_;
    line_index_ = other_end;
    Cursor for_cursor = cursor_of_line(other_end);
    for_cursor.at = parse_line_head(for_cursor.text).end;
    try {
      // An error is reported at the line of ENDFOR.
      execute_for(for_cursor, false);
    } catch (const BadInput&) {
      line_index_ = endfor_line;
      throw;
    }
  } else if (word == "WHILE") {
    const bool is_true = evaluate_condition(cursor);
    expect_end(cursor);
    line_index_ = is_true ? line_index_ + 1 : other_end + 1;
  } else if (word == "ENDWHILE" || word == "ENDLOOP") {
    expect_end(cursor);
    line_index_ = other_end;
  } else if (word == "UNTIL") {
    const bool is_true = evaluate_condition(cursor);
    expect_end(cursor);
    line_index_ = is_true ? line_index_ + 1 : other_end;
  } else {  // LOOP, REPEAT
    expect_end(cursor);
    ++line_index_;
  }
}

/// Executes FOR count = first TO last. Sets the counter if the loop begins, else adds one to it.
/// Execution then continues after FOR, or after ENDFOR if the counter is above the limit.
void Flow::execute_for(Cursor& cursor, bool first) {
  const std::size_t from = skip_blanks(cursor);
  // Position of the word TO, between the assignment and the limit.
  const std::size_t to_position = [&] {
    for (std::size_t at = from; at + 2 < cursor.text.size(); ++at)
      if (is_blank(cursor.text[at]) && upper(cursor.text[at + 1]) == 'T' &&
          upper(cursor.text[at + 2]) == 'O' &&
          (at + 3 == cursor.text.size() || !is_name_char(cursor.text[at + 3])))
        return at;
    cursor.throw_input_error(from, "FOR variable = first TO last");
  }();
  Cursor assignment{cursor.text.substr(0, to_position), cursor.location, from};
  Cursor counter = assignment;
  if (first) {
    if (!assign_variable(assignment))
      cursor.throw_input_error(from, "a defined variable after FOR");
    expect_end(assignment);
    counter.at = from;
  }
  const auto count = parse_operand(counter);
  if (!count) cursor.throw_input_error(from, "a defined variable after FOR");
  double value = *count;
  // The counter may be any kind of variable, so it is assigned by executing a text with all its
  // digits.
  if (!first) {
    value += 1.0;
    const std::string text =
        std::string(counter.text.substr(from, counter.at - from)) + fmt::format("={:.17g}", value);
    Cursor increment{text, cursor.location};
    assign_variable(increment);
  }
  Cursor limit_cursor{cursor.text, cursor.location, to_position + 3};
  const double limit = parse_number(limit_cursor, *this);
  expect_end(limit_cursor);
  line_index_ = value <= limit ? line_index_ + 1 : counterpart(cursor, line_index_).line + 1;
}

void Flow::execute_jump(Cursor& cursor, const std::string& keyword) {
  const std::size_t from = skip_blanks(cursor);
  std::string label;
  while (is_name_char(cursor.current())) label += upper(cursor.text[cursor.at++]);
  if (label.empty()) cursor.throw_input_error(from, "a label or a line number after " + keyword);
  const Cause cause = cursor.cause(from);
  expect_end(cursor);
  line_index_ = line_of(label, keyword, cause);
}

std::size_t Flow::line_of(const std::string& label, const std::string& keyword,
                          const Cause& cause) {
  Program& program = *calls_.back().program;
  // Labels are collected once for each program. A label may occur several times.
  if (!program.labels) {
    program.labels.emplace();
    for (std::size_t line_index = 0; line_index < program.lines.size(); ++line_index) {
      const LineHead head = parse_line_head(split_comment(program.lines[line_index]).block);
      if (!head.label.empty()) (*program.labels)[head.label].push_back(line_index);
      if (!head.number.empty())
        (*program.labels)["N" + std::string(head.number)].push_back(line_index);
    }
  }
  const auto entry = program.labels->find(label);
  if (entry != program.labels->end()) {
    const std::vector<std::size_t>& lines = entry->second;
    // GOTOF searches forwards, GOTOB backwards; GOTO forwards first, then from the beginning.
    const auto next = std::upper_bound(lines.begin(), lines.end(), line_index_);
    const bool is_forwards = keyword == "GOTOF", is_backwards = keyword == "GOTOB";
    if (!is_backwards && next != lines.end()) return *next;
    if (is_backwards && next != lines.begin()) return *(next - 1);
    if (!is_forwards && !is_backwards) return lines.front();
  }
  // GOTOC ignores a missing label.
  if (keyword == "GOTOC") return line_index_ + 1;
  run_.refuse_once(keyword + " " + label, cause,
                   keyword == "GOTOF"   ? "a label on a later line"
                   : keyword == "GOTOB" ? "a label on an earlier line"
                                        : "a label of this program");
}

/// Executes CASE, for example CASE value OF 1 GOTOF A 2 GOTOB B DEFAULT GOTOF C.
void Flow::execute_case(Cursor& cursor) {
  const double selector = parse_number(cursor, *this);
  if (!cursor.accept_word("OF")) cursor.throw_input_error(cursor.at, "OF after the value of CASE");
  bool is_default = false;
  while (true) {
    cursor.skip_blanks();
    if (cursor.at_end()) break;
    is_default = cursor.accept_word("DEFAULT");
    const bool is_selected = is_default || parse_number(cursor, *this) == selector;
    const std::size_t from = skip_blanks(cursor);
    const std::string keyword = parse_name(cursor);
    if (!is_jump(keyword))
      cursor.throw_input_error(from, "GOTOF, GOTOB or GOTO after a value of CASE");
    const std::size_t label_from = skip_blanks(cursor);
    while (is_name_char(cursor.current())) ++cursor.at;
    if (!is_selected) continue;
    Cursor label{cursor.text.substr(0, cursor.at), cursor.location, label_from};
    return execute_jump(label, keyword);
  }
  ++line_index_;
}

}  // namespace abbe::sim::dialects::siemens

void abbe::sim::dialects::read_siemens(std::string_view text, ProgramRun& run) {
  siemens::Flow(text, run).run();
}
