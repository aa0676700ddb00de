#include <gtest/gtest.h>

#include <cstdlib>
#include <fstream>
#include <iterator>
#include <set>
#include <sstream>

#include "sim/dialects/read_program.h"

/// The tables of words in the document are those of the front ends. ABBE_WRITE_WORDS=1 writes them.
namespace abbe::sim::dialects {
namespace {

const std::string file = std::string(ABBE_SOURCE_DIR) + "/sim/dialects/README.md";
const std::string begin_mark = "<!-- words -->\n", end_mark = "<!-- end of words -->";

std::string made_again(const std::string& document) {
  const std::size_t begin = document.find(begin_mark), end = document.find(end_mark);
  if (begin == std::string::npos || end == std::string::npos) return "no marks";
  std::string tables;
  const auto add = [&](std::string_view title, std::span<const WordTableEntry> words) {
    tables += "### " + std::string(title) + "\n\n" + markdown_table(words) + "\n";
  };
  for (const FrontEnd& one : front_ends()) {
    add(one.title, one.words());
    if (one.turning_words != nullptr) add(one.turning_title, one.turning_words());
  }
  return document.substr(0, begin + begin_mark.size()) + tables + document.substr(end);
}

TEST(WordTables, OfTheDocumentAreThoseOfTheFrontEnds) {
  std::ifstream in(file, std::ios::binary);
  const std::string document{std::istreambuf_iterator<char>(in), {}};
  const std::string again = made_again(document);
  if (std::getenv("ABBE_WRITE_WORDS") != nullptr)
    std::ofstream(file, std::ios::binary) << again;
  else
    EXPECT_EQ(document, again) << "ABBE_WRITE_WORDS=1 writes it";
}

void expect_every_word_once(std::string_view title, std::span<const WordTableEntry> table) {
  std::set<std::string> seen;
  for (const WordTableEntry& line : table) {
    EXPECT_GT(line.sentence.size(), 3u) << line.word;
    std::istringstream words{std::string(line.word)};
    for (std::string word; words >> word;)
      EXPECT_TRUE(seen.insert(word).second) << title << " has " << word << " twice";
  }
}

TEST(WordTables, SayEveryWordOnceWithASentence) {
  for (const FrontEnd& one : front_ends()) {
    expect_every_word_once(one.title, one.words());
    if (one.turning_words != nullptr)
      expect_every_word_once(one.turning_title, one.turning_words());
  }
}

}  // namespace
}  // namespace abbe::sim::dialects
