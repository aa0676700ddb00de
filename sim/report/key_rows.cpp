#include "sim/report/key_rows.h"

#include <algorithm>

#include <fmt/format.h>

#include "sim/files/matches.h"

namespace abbe::sim {

namespace {

std::string range_of(const Range& range) {
  const double huge = std::numeric_limits<double>::max();
  const bool below = range.min > -huge, above = range.max < huge;
  if (!below && !above) return "";
  if (below && above && !range.open_min && !range.open_max)
    return fmt::format("{:.12g} to {:.12g}", range.min, range.max);
  std::string text;
  if (below) text += fmt::format("{} {:.12g}", range.open_min ? ">" : "≥", range.min);
  if (above)
    text += fmt::format("{}{} {:.12g}", text.empty() ? "" : ", ", range.open_max ? "<" : "≤",
                        range.max);
  return text;
}

std::string or_list(const std::vector<Word>& words) {
  std::string text;
  for (std::size_t i = 0; i < words.size(); ++i) {
    text += i == 0 ? "" : i + 1 == words.size() ? " or " : ", ";
    text += "\"" + words[i].word + "\"";
  }
  return text;
}

std::string value_of(const Key& key) {
  using Kind = Key::Kind;
  const std::string file = key.or_file ? " or file" : "";
  const std::string range = range_of(key.range);
  switch (key.kind) {
    case Kind::Number:
      return range.empty() ? "number" : range;
    case Kind::Whole:
      return key.range.max > 1e15 ? fmt::format("whole number ≥ {:.12g}", key.range.min)
                                  : "whole number, " + range;
    case Kind::Boolean:
      return "true or false";
    case Kind::Text:
      return key.words.empty() ? "text" : or_list(key.words);
    case Kind::Numbers:
      return key.size > 0 ? fmt::format("{} numbers", key.size) : "list of numbers";
    case Kind::NumberOrNumbers:
      return (range.empty() ? "number" : range) + fmt::format(", or {} numbers", key.size);
    case Kind::Texts:
      return "list of texts";
    case Kind::Table:
      return "table" + file;
    case Kind::Tables:
      return "list of tables" + file;
    case Kind::Any:
      break;
  }
  return "";
}

std::string unit_of_key(const Key& key) {
  const bool has_one = key.kind == Key::Kind::Number || key.kind == Key::Kind::Numbers ||
                       key.kind == Key::Kind::NumberOrNumbers;
  return has_one && stem_of(key.name) != key.name ? unit_name(key.name) : "";
}

/// What the words of a key mean, where that is said.
std::string words_text(const Key& key) {
  std::string text;
  for (const Word& word : key.words)
    if (!word.sentence.empty())
      text += fmt::format("{}\"{}\": {}", text.empty() ? "" : "; ", word.word, word.sentence);
  return text;
}

std::string joined(const std::string& path, const std::string& name) {
  return path.empty() ? name : path + "." + name;
}

/// Words that bring the same keys.
struct WordGroup {
  std::vector<std::string> words;
  std::vector<Key> keys;
};

bool are_alike(const std::vector<Key>& a, const std::vector<Key>& b) {
  return std::equal(a.begin(), a.end(), b.begin(), b.end(), [](const Key& x, const Key& y) {
    return x.name == y.name && x.sentence == y.sentence && x.fallback == y.fallback;
  });
}

std::vector<WordGroup> groups_of(const Key& key) {
  std::vector<WordGroup> groups;
  for (const Word& word : key.words) {
    const auto like = std::find_if(groups.begin(), groups.end(), [&](const WordGroup& group) {
      return are_alike(group.keys, word.keys);
    });
    if (like == groups.end())
      groups.push_back({{word.word}, word.keys});
    else
      like->words.push_back(word.word);
  }
  return groups;
}

/// `kind = "a" or "b"`, or which it is not where these are fewer.
std::string when_of(const Key& key, const WordGroup& group) {
  std::vector<Word> own, others;
  for (const Word& word : key.words) {
    const bool in =
        std::find(group.words.begin(), group.words.end(), word.word) != group.words.end();
    (in ? own : others).push_back({word.word, "", {}});
  }
  if (others.empty()) return "";
  return own.size() <= others.size() ? key.name + " = " + or_list(own)
                                     : key.name + " other than " + or_list(others);
}

class Rows {
 public:
  void add(const std::vector<Key>& keys, const std::string& path, const std::string& when) {
    for (const Key& key : keys) add(key, path, when);
  }
  std::vector<KeyRow> rows;

 private:
  static constexpr std::size_t most_in_a_row = 7;  // words; more have rows of their own

  void add(const Key& key, const std::string& path, const std::string& when) {
    const std::string own = joined(path, key.name);
    const bool apart = key.words.size() > most_in_a_row;
    const std::string words = apart ? "" : words_text(key);
    std::string sentence = key.sentence;
    if (!words.empty()) sentence += (sentence.empty() ? "" : ": ") + words;
    rows.push_back({own, when, key.required, unit_of_key(key), apart ? "a word" : value_of(key),
                    key.fallback, sentence});
    for (const Word& word : key.words)
      if (apart)
        rows.push_back({own + " = \"" + word.word + "\"", when, false, "", "", "", word.sentence});
    add(key.keys, own, "");
    for (const WordGroup& group : groups_of(key)) add(group.keys, path, when_of(key, group));
  }
};

bool is_called(const Key& key, const std::string& name) {
  if (key.name == name) return true;
  return !key.pattern.empty() && matches(name, key.pattern);
}

std::vector<std::string> parts_of(std::string_view path) {
  std::vector<std::string> parts;
  for (std::size_t from = 0; from <= path.size();) {
    const std::size_t dot = std::min(path.find('.', from), path.size());
    parts.emplace_back(path.substr(from, dot - from));
    from = dot + 1;
  }
  return parts;
}

struct Found {
  Key key;
  std::string path;  ///< of its table
  std::string when;
};

/// Keys of that name, also those that words bring.
void find(const std::vector<Key>& keys, const std::string& name, const Found& in,
          std::vector<Found>& found) {
  for (const Key& key : keys) {
    if (is_called(key, name)) found.push_back({key, in.path, in.when});
    for (const Word& word : key.words)
      find(word.keys, name, {{}, in.path, fmt::format("{} = \"{}\"", key.name, word.word)}, found);
  }
}

std::vector<Found> found_at(const std::vector<Key>& keys, std::string_view path) {
  std::vector<Found> here{{{}, "", ""}};
  here.front().key.keys = keys;
  for (const std::string& part : parts_of(path)) {
    std::vector<Found> next;
    for (const Found& one : here) {
      const std::string own = joined(one.path, one.key.name);
      find(one.key.keys, part, {{}, own, ""}, next);
    }
    const bool index = part.find_first_not_of("0123456789") == std::string::npos;
    if (!next.empty() || !index) here = std::move(next);
  }
  return here;
}

/// Keys of that name anywhere below.
void find_anywhere(const std::vector<Key>& keys, const std::string& name, const Found& in,
                   std::vector<Found>& found) {
  for (const Key& key : keys) {
    if (is_called(key, name)) found.push_back({key, in.path, in.when});
    find_anywhere(key.keys, name, {{}, joined(in.path, key.name), ""}, found);
    for (const Word& word : key.words)
      find_anywhere(word.keys, name, {{}, in.path, fmt::format("{} = \"{}\"", key.name, word.word)},
                    found);
  }
}

}  // namespace

std::vector<KeyRow> key_rows(const std::vector<Key>& keys, const std::string& path) {
  Rows rows;
  rows.add(keys, path, "");
  return std::move(rows.rows);
}

std::string to_text(const std::vector<KeyRow>& rows) {
  std::string text;
  for (const KeyRow& row : rows) {
    text += row.path;
    if (!row.when.empty()) text += "  where " + row.when;
    text += "\n    " + row.value + (row.unit.empty() ? "" : " (" + row.unit + ")");
    if (row.required) text += "; must be given";
    if (!row.fallback.empty()) text += "; default " + row.fallback;
    text += "\n";
    if (!row.sentence.empty()) text += "    " + row.sentence + "\n";
  }
  return text;
}

std::vector<Key> keys_at(const std::vector<Key>& keys, std::string_view path) {
  for (const Found& one : found_at(keys, path))
    if (!one.key.keys.empty()) return one.key.keys;
  return {};
}

std::vector<KeyRow> explained(const std::vector<Key>& keys, std::string_view question) {
  std::vector<Found> found = found_at(keys, question);
  if (found.empty() && question.find('.') == std::string_view::npos)
    find_anywhere(keys, std::string(question), {}, found);
  std::vector<KeyRow> rows;
  for (const Found& one : found) {
    std::vector<KeyRow> own = key_rows({one.key}, one.path);
    own.front().when = one.when;
    const auto like = std::find_if(rows.begin(), rows.end(), [&](const KeyRow& row) {
      return row.path == own.front().path && row.value == own.front().value &&
             row.fallback == own.front().fallback && row.sentence == own.front().sentence;
    });
    if (like == rows.end())
      rows.insert(rows.end(), own.begin(), own.end());
    else if (!one.when.empty())
      like->when += ", " + one.when.substr(one.when.find('"'));
  }
  return rows;
}

}  // namespace abbe::sim
