// The Chinese pages say what the English ones say: commands, figures, links; and the glossary has
// one Chinese term for one English term.

#include <filesystem>
#include <fstream>
#include <iterator>
#include <map>
#include <regex>
#include <set>
#include <sstream>
#include <string>
#include <vector>

#include <gtest/gtest.h>

namespace abbe::sim {
namespace {

namespace fs = std::filesystem;

const fs::path source = ABBE_SOURCE_DIR;

struct Pair {
  const char* english;
  const char* chinese;
};

const Pair pages[] = {{"README.md", "README.zh.md"}, {"scenes/TOUR.md", "scenes/TOUR.zh.md"}};

std::string text_of(const fs::path& file) {
  std::ifstream in(file);
  EXPECT_TRUE(in) << file;
  return {std::istreambuf_iterator<char>(in), {}};
}

/// The indented lines of a page, which are its commands and its drawing of the folders.
std::vector<std::string> code_lines(const std::string& page) {
  std::vector<std::string> lines;
  std::istringstream in(page);
  for (std::string line; std::getline(in, line);)
    if (line.rfind("    ", 0) == 0) lines.push_back(line);
  return lines;
}

/// How often each match of `pattern`'s last group stands in a page.
std::map<std::string, int> counted(const std::string& page, const char* pattern) {
  const std::regex wanted(pattern);
  std::map<std::string, int> count;
  for (std::sregex_iterator match(page.begin(), page.end(), wanted), end; match != end; ++match)
    ++count[(*match)[match->size() - 1].str()];
  return count;
}

std::map<std::string, int> figures(const std::string& page) {
  return counted(page, R"((\d+(?:\.\d+)*))");
}

/// Where the links and pictures of a page lead, those to other sites left out.
std::set<std::string> relative_links(const std::string& page) {
  std::set<std::string> links;
  for (const auto& [link, ignored] : counted(page, R"(\]\(([^)\s]+)\))"))
    if (link.find("://") == std::string::npos) links.insert(link.substr(0, link.find('#')));
  return links;
}

struct Term {
  std::string english, chinese;
};

std::vector<Term> terms_of(const std::string& glossary) {
  static const std::regex row(R"(\| ([^|]+) \| ([^|]+) \|([^|]*)\| ([^|]+) \|)");
  std::vector<Term> terms;
  std::istringstream in(glossary);
  for (std::string line; std::getline(in, line);) {
    if (line.rfind("| ", 0) != 0) continue;
    std::smatch cells;
    EXPECT_TRUE(std::regex_match(line, cells, row)) << "not a row of four cells: " << line;
    if (cells.size() > 2 && cells[1] != "English") terms.push_back({cells[1], cells[2]});
  }
  return terms;
}

/// The terms, of either language, that stand in more than one row.
std::set<std::string> repeated(const std::vector<Term>& terms) {
  std::set<std::string> seen, twice;
  for (const Term& term : terms)
    for (const std::string& word : std::set<std::string>{term.english, term.chinese})
      if (!seen.insert(word).second) twice.insert(word);
  return twice;
}

}  // namespace

TEST(ChineseDocuments, CommandsAreThoseOfTheEnglishPages) {
  for (const Pair& page : pages) {
    const auto english = code_lines(text_of(source / page.english));
    EXPECT_GT(english.size(), 10u) << page.english;
    EXPECT_EQ(code_lines(text_of(source / page.chinese)), english) << page.chinese;
  }
}

TEST(ChineseDocuments, FiguresAreThoseOfTheEnglishPages) {
  for (const Pair& page : pages) {
    const auto english = figures(text_of(source / page.english));
    EXPECT_GT(english.size(), 10u) << page.english;
    EXPECT_EQ(figures(text_of(source / page.chinese)), english) << page.chinese;
  }
}

TEST(ChineseDocuments, LinksLeadSomewhereAndNoneIsMissing) {
  for (const Pair& page : pages) {
    const auto english = relative_links(text_of(source / page.english));
    const auto chinese = relative_links(text_of(source / page.chinese));
    const std::string other = fs::path(page.chinese).filename().string();
    EXPECT_TRUE(english.count(other)) << page.english << " does not lead to " << other;
    EXPECT_TRUE(chinese.count(fs::path(page.english).filename().string())) << page.chinese;
    for (const std::string& link : english)
      EXPECT_TRUE(link == other || chinese.count(link)) << page.chinese << " lacks " << link;
    for (const std::string& link : chinese)
      EXPECT_TRUE(fs::exists((source / page.chinese).parent_path() / link))
          << page.chinese << ": " << link;
  }
}

TEST(ChineseDocuments, TheGlossaryHasEveryTermOnce) {
  const std::vector<Term> terms = terms_of(text_of(source / "scenes/GLOSSARY.md"));
  EXPECT_GE(terms.size(), 80u);
  for (const std::string& word : repeated(terms)) ADD_FAILURE() << word << " stands twice";
}

TEST(ChineseDocuments, ATermThatStandsTwiceIsFound) {
  EXPECT_TRUE(repeated({{"part", "零件"}, {"blank", "毛坯"}}).empty());
  EXPECT_EQ(repeated({{"part", "零件"}, {"part", "工件"}}), std::set<std::string>{"part"});
  EXPECT_EQ(repeated({{"part", "零件"}, {"blank", "零件"}}), std::set<std::string>{"零件"});
}

}  // namespace abbe::sim
