#include "sim/dialects/fanuc_block.h"

#include <cmath>

#include <fmt/format.h>

#include "kinematics/bad_input.h"
#include "kinematics/text.h"

namespace abbe::sim::dialects::fanuc {
namespace {

constexpr std::string_view known_letters = "ABCDFGHIJKLMNPQRSTUVWXYZ";
constexpr std::size_t most_words = 100;

std::string_view comment_at(Cursor& cursor) {
  const std::size_t open = cursor.at;
  for (++cursor.at; !cursor.at_end(); ++cursor.at)
    if (cursor.here() == ')') return cursor.text.substr(open + 1, cursor.at++ - open - 1);
  cursor.refuse(open, ") that ends the comment on its line", "none");
}

}  // namespace

void Block::clear() {
  words.clear();
  codes.clear();
  percent = false;
  skipped = wordless = {};
  arguments.clear();
  comments.clear();
}

int whole(const program::Canon& canon, const Word& word, int most) {
  const double near = std::round(word.value);
  const bool written = word.text.find_first_of("#[") == std::string_view::npos;
  if ((written && word.pointed) || near < 0 || near > most)
    canon.refuse(word, fmt::format("a whole number of 0 to {} without a decimal point", most));
  return int(near);
}

double least_increment(char letter, bool inch) {
  return inch && !(letter >= 'A' && letter <= 'C') ? 1e-4 : 1e-3;
}

int skip_level(Cursor& cursor) {
  const bool numbered = is_digit(cursor.next());
  const int level = numbered ? cursor.next() - '0' : 1;
  cursor.at += numbered ? 2 : 1;
  return level;
}

void pass_comments(Cursor& cursor, std::vector<std::string_view>& comments) {
  for (cursor.skip_blanks(); cursor.here() == '('; cursor.skip_blanks())
    comments.push_back(comment_at(cursor));
}

class BlockReader {
 public:
  BlockReader(Cursor& cursor, ProgramRun& run, MacroOperands& operands, Block& block)
      : cursor_(cursor), run_(run), operands_(operands), block_(block) {}

  void fill();

 private:
  bool ends();
  void word();
  void put_code(const Word& word);
  void put_word(const Word& word);

  Cursor& cursor_;
  ProgramRun& run_;
  MacroOperands& operands_;
  Block& block_;
};

/// The end of the block: of the line, ; with nothing behind it, or / with what is left out.
bool BlockReader::ends() {
  pass_comments(cursor_, block_.comments);
  if (cursor_.at_end()) return true;
  if (cursor_.here() == ';') {
    ++cursor_.at;
    pass_comments(cursor_, block_.comments);
    if (!cursor_.at_end()) cursor_.refuse(cursor_.at, "the next block on a line of its own");
    return true;
  }
  if (cursor_.here() != '/') return false;
  return run_.skips(skip_level(cursor_)) || ends();
}

void BlockReader::put_code(const Word& word) {
  const double scaled = word.value * 10, tenths = std::round(scaled);
  const bool is_code = tenths >= 0 && tenths < 1e4 && std::abs(scaled - tenths) < 1e-3;
  const int code = is_code ? int(tenths) : -1;
  const CodeFact& fact =
      run_.turning() ? lathe_fact_of(word.letter, code) : fact_of(word.letter, code);
  if (!fact.known) {
    run_.unknown(word, fmt::format("a {} code of Fanuc's {} controls", word.letter,
                                   run_.turning() ? "turning" : "milling"));
    block_.skipped = word;
    return;
  }
  if (fact.use == Use::Refused) run_.canon.refuse(word, std::string(fact.sentence));
  if (fact.group == Group::None) block_.wordless = word;
  if (fact.group == Group::None || fact.group == Group::Beside) return;
  const Code& place = block_[fact.group];
  const bool one = word.letter == 'M' ? fact.group != Group::Coolant : fact.group == Group::OneShot;
  if (place && one)
    run_.canon.refuse(word, "one such code in a block",
                      fmt::format("{} after {}", shown(word.text), shown(place.word.text)));
  block_.codes.put(std::size_t(fact.group), {code, word});
}

void BlockReader::put_word(const Word& word) {
  const Word& place = block_[word.letter];
  if (place)
    run_.canon.refuse(word, std::string("one ") + word.letter + " in a block",
                      fmt::format("{} after {}", shown(word.text), shown(place.text)));
  block_.words.put(std::size_t(word.letter - 'A'), word);
}

void BlockReader::word() {
  const std::size_t from = cursor_.at;
  Word word;
  word.letter = upper(cursor_.here());
  if (word.letter == ',')
    cursor_.refuse(from, "lines and arcs as they are: ,C and ,R of corners are not expanded");
  if (!is_letter(word.letter))
    cursor_.refuse(from, "a word (letter and number)",
                   word.letter == ')' ? ") without (" : shown(cursor_.cell(from)));
  ++cursor_.at;
  word.column = int(from) + 1;
  cursor_.skip_blanks();
  if (cursor_.at_end())
    cursor_.refuse(from, std::string("a number after ") + word.letter, "the end of the line");
  operands_.resolution = least_increment(word.letter, run_.canon.inch());
  word.value = value(cursor_, grammar(), operands_);
  word.text = cursor_.text.substr(from, cursor_.at - from);
  word.pointed = word.text.find_first_of(".#[") != std::string_view::npos;
  if (is_vacant(word.value)) return;
  const int macro = block_.tenths(Group::Macro);
  const bool calls = macro == 650 || macro == 660;
  if (word.letter == 'G') return put_code(word);
  if (word.letter == 'N') return run_.canon.refuse(word, "a sequence number first in its block");
  if (calls && std::string_view("LP").find(word.letter) == std::string_view::npos) {
    if (block_.arguments.size() == most_words) cursor_.refuse(from, "at most 100 arguments");
    block_.arguments.push_back(word);
    return;
  }
  if (word.letter == 'M') return put_code(word);
  if (known_letters.find(word.letter) == std::string_view::npos)
    return run_.unknown(word, "a word of Fanuc's milling controls");
  put_word(word);
}

void BlockReader::fill() {
  cursor_.skip_blanks();
  if (cursor_.here() == '%') {
    block_.percent = true;  // what stands behind it is outside of the program
    return;
  }
  while (!ends()) word();
}

void read_block(Cursor cursor, ProgramRun& run, MacroOperands& operands, Block& block) {
  block.clear();
  if (const std::size_t nul = cursor.text.find('\0'); nul != std::string_view::npos)
    cursor.refuse(nul, "text", "a NUL byte");
  BlockReader(cursor, run, operands, block).fill();
}

}  // namespace abbe::sim::dialects::fanuc
