#include "sim/dialects/gcode.h"

namespace abbe::sim::dialects::gcode {

bool is_beside_motion(Group group) {
  static constexpr Group others[] = {Group::None,    Group::WholeBlock, Group::MirrorEnd,
                                     Group::OneShot, Group::Rotation,   Group::Macro};
  return std::ranges::find(others, group) == std::end(others);
}

void Block::clear() {
  words.clear();
  codes.clear();
  is_deleted = is_percent_line = false;
  skipped_code = code_forbidding_axis_words = {};
  arguments.clear();
  comments.clear();
  number_assignments.clear();
  name_assignments.clear();
}

const Word* Block::first_word(std::string_view letters) const {
  const Word* first = nullptr;
  for (const char letter : letters)
    if (const Word& word = (*this)[letter];
        word && (first == nullptr || word.column < first->column))
      first = &word;
  return first;
}

BlockReader::BlockReader(Cursor& cursor, ProgramRun& run, Block& block)
    : cursor_(cursor), run_(run), block_(block) {
  block.clear();
  // A NUL is not visible in messages, so its name is reported.
  if (const std::size_t nul = cursor.text.find('\0'); nul != std::string_view::npos)
    cursor.throw_input_error(nul, "text", "a NUL byte");
}

Word BlockReader::read_letter(std::string_view signs) {
  const std::size_t from = cursor_.at;
  Word word;
  word.letter = upper(cursor_.current());
  if (!is_letter(word.letter) && signs.find(word.letter) == std::string_view::npos)
    cursor_.throw_input_error(
        from, "a word (letter and number)",
        word.letter == ')' ? ") without (" : shown(cursor_.text_until_blank(from)));
  ++cursor_.at;
  word.column = int(from) + 1;
  cursor_.skip_blanks();
  if (cursor_.at_end())
    cursor_.throw_input_error(from, std::string("a number after ") + word.letter,
                              "the end of the line");
  return word;
}

void BlockReader::read_number(Word& word, const ExpressionGrammar& grammar,
                              OperandParser& operands) {
  const std::size_t from = std::size_t(word.column - 1);
  word.value = parse_value(cursor_, grammar, operands);
  word.text = cursor_.text.substr(from, cursor_.at - from);
}

std::string_view read_comment(Cursor& cursor) {
  const std::size_t open = cursor.at, close = cursor.text.find(')', open);
  if (close == std::string_view::npos)
    cursor.throw_input_error(open, ") that ends the comment on its line", "none");
  cursor.at = close + 1;
  return cursor.text.substr(open + 1, close - open - 1);
}

int tenths_of(const Word& word) {
  // The tolerance allows computed codes such as G[#1].
  const double scaled = word.value * 10, tenths = std::round(scaled);
  const bool is_code = tenths >= 0 && tenths < 1e4 && std::abs(scaled - tenths) < 1e-3;
  return is_code ? int(tenths) : -1;
}

const CodeProperties* BlockReader::find_code(const Word& word, std::string_view control,
                                             const CodeProperties& (*find_entry)(char, int)) {
  const CodeProperties& properties = find_entry(word.letter, tenths_of(word));
  if (!properties.known) {
    run_.handle_unknown_word(word, fmt::format("a {} code of {}", word.letter, control));
    block_.skipped_code = word;
    return nullptr;
  }
  if (properties.use == WordTreatment::Refused)
    run_.canon.throw_input_error(word, std::string(properties.sentence));
  if (properties.group == Group::None) block_.code_forbidding_axis_words = word;
  const bool has_group = properties.group != Group::None && properties.group != Group::WithMotion;
  return has_group ? &properties : nullptr;
}

void BlockReader::put_code(const Word& word, Group group, bool must_be_unique,
                           std::string_view expected) {
  const Code& previous = block_[group];
  if (previous && must_be_unique)
    run_.canon.throw_input_error(
        word, std::string(expected),
        fmt::format("{} after {}", shown(word.text), shown(previous.word.text)));
  block_.codes.put(std::size_t(group), {tenths_of(word), word});
}

void BlockReader::put_word(const Word& word) {
  if (const Word& previous = block_[word.letter])
    run_.canon.throw_input_error(
        word, std::string("only one ") + word.letter + " per block",
        fmt::format("{} after {}", shown(word.text), shown(previous.text)));
  block_.words.put(Block::slot(word.letter), word);
}

std::string_view letters_of_code(std::span<const CodeLetters> table, int tenths) {
  const auto entry = std::ranges::find(table, tenths, &CodeLetters::tenths);
  return entry == table.end() ? std::string_view() : entry->letters;
}

void mark_stated_modes(ProgramRun& run, const Block& block) {
  static constexpr std::pair<Group, StartMode> groups[] = {
      {Group::Units, StartMode::Units},          {Group::Distance, StartMode::Distance},
      {Group::Plane, StartMode::Plane},          {Group::FeedMode, StartMode::Feed},
      {Group::Motion, StartMode::Motion},        {Group::Cycle, StartMode::Motion},
      {Group::WorkOffset, StartMode::WorkOffset}};
  for (const auto& [group, mode] : groups)
    if (block[group]) run.mark_stated(mode);
}

void check_skipped_code(const program::Canon& canon, const Block& block, const Word* axis) {
  if (axis == nullptr || block.skipped_code.letter != 'G') return;
  canon.throw_input_error(
      *axis, "no axis words with a code that is skipped: their effect is unknown",
      fmt::format("{} with {}", shown(axis->text), shown(block.skipped_code.text)));
}

void check_forbidden_axis_words(const program::Canon& canon, const Block& block, const Word* axis) {
  const Word& code = block.code_forbidding_axis_words;
  if (axis == nullptr || !code) return;
  canon.throw_input_error(*axis,
                          fmt::format("no axis words with {}, which takes none", shown(code.text)));
}

void record_tool_and_coolant(program::Canon& canon, const Block& block, std::string tool) {
  const auto add_word = [&](bool is_programmed, const char* word) {
    if (is_programmed) tool += std::string(tool.empty() ? "" : " ") + word;
  };
  add_word(block.tenths(Group::ToolChange) == 60, "M6");
  add_word(block.tenths(Group::Coolant) == 70, "M7");
  add_word(block.tenths(Group::Coolant) == 80, "M8");
  if (!tool.empty()) canon.record_auxiliary_word(std::move(tool));
}

bool finish_block(program::Canon& canon, const Block& block) {
  if (block.tenths(Group::Coolant) == 90) canon.record_auxiliary_word("M9");
  const Code& stop = block[Group::Stop];
  if (stop && stop.tenths <= 10) canon.record_auxiliary_word(fmt::format("M{}", stop.tenths / 10));
  return !(stop && (stop.tenths == 20 || stop.tenths == 300));
}

}  // namespace abbe::sim::dialects::gcode
