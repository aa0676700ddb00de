#include "sim/dialects/used_words.h"

#include <array>
#include <optional>
#include <unordered_map>

#include "kinematics/text.h"
#include "sim/dialects/cursor.h"
#include "sim/dialects/front_ends.h"

namespace abbe::sim::dialects {
namespace {

constexpr std::size_t longest_word = 40;

/// Upper case in a buffer of its own: no memory is taken for each of a million words.
struct Word {
  std::array<char, longest_word> letters{};
  std::size_t size = 0;

  void put(char c) {
    if (size < letters.size()) letters[size++] = c;
  }
  std::string_view text() const { return {letters.data(), size}; }
};

/// The words of a dialect by their text.
using Index = std::unordered_map<std::string_view, const WordUse*>;

Index index_of(std::span<const WordUse> table) {
  Index index;
  for (const WordUse& line : table)
    for (std::size_t at = 0; at < line.word.size();) {
      const std::size_t end = std::min(line.word.find(' ', at), line.word.size());
      index.emplace(line.word.substr(at, end - at), &line);
      at = end + 1;
    }
  return index;
}

/// Counts what a scanner of lines finds.
class Tally {
 public:
  explicit Tally(Index index) : index_(std::move(index)) {}

  bool add(std::string_view word, int line) {
    const auto known = index_.find(word);
    if (known == index_.end()) return false;
    const auto [at, is_new] = places_.try_emplace(known->first, words_.size());
    if (is_new)
      words_.push_back({std::string(word), known->second->use, known->second->sentence, 0, line});
    ++words_[at->second].count;
    return true;
  }
  std::vector<UsedWord> take() { return std::move(words_); }

 private:
  Index index_;
  std::unordered_map<std::string_view, std::size_t> places_;
  std::vector<UsedWord> words_;
};

/// A word and the number behind it: the code as G1 of G01, else the word alone.
void count_one(std::string_view line, std::size_t& at, int number, Tally& tally) {
  Word word;
  while (at < line.size() && (is_letter(line[at]) || line[at] == '_')) word.put(upper(line[at++]));
  Word code = word;
  std::size_t from = at;
  while (from + 1 < line.size() && line[from] == '0' && is_digit(line[from + 1])) ++from;
  std::size_t end = from;
  while (end < line.size() && (is_digit(line[end]) || line[end] == '.')) code.put(line[end++]);
  if (end > at && tally.add(code.text(), number)) {
    at = end;
    return;
  }
  tally.add(word.text(), number);
  at = end;
}

/// A line of words, what stands in ( ) or " " and behind ; left out.
void count_line(std::string_view line, int number, Tally& tally) {
  for (std::size_t at = 0; at < line.size();) {
    const char c = line[at];
    if (c == ';') return;
    if (c == '(' || c == '"') {
      const std::size_t end = line.find(c == '(' ? ')' : '"', at + 1);
      if (end == std::string_view::npos) return;
      at = end + 1;
    } else if (is_letter(c)) {
      count_one(line, at, number, tally);
    } else {
      ++at;
    }
  }
}

/// A statement of cutter locations: its first word.
void count_major(std::string_view line, int number, Tally& tally) {
  std::size_t at = 0;
  while (at < line.size() && is_blank(line[at])) ++at;
  Word word;
  while (at < line.size() &&
         (is_letter(line[at]) || is_digit(line[at]) || line[at] == '-' || line[at] == '_'))
    word.put(upper(line[at++]));
  tally.add(word.text(), number);
}

}  // namespace

std::vector<UsedWord> used_words(std::string_view text, Dialect dialect, bool turning) {
  for (const FrontEnd& one : front_ends()) {
    if (one.dialect != dialect) continue;
    const bool other = turning && one.turning_words != nullptr;
    std::span<const WordUse> words = other ? one.turning_words() : one.words();
    Tally tally(index_of(words));
    Lines lines(text);
    while (const auto line = lines.next()) {
      if (dialect == Dialect::Cl)
        count_major(*line, lines.number(), tally);
      else
        count_line(*line, lines.number(), tally);
    }
    return tally.take();
  }
  return {};
}

}  // namespace abbe::sim::dialects
