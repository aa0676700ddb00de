// The Chinese pages say what the English ones say: commands, figures, links; and the glossary has
// one Chinese term for one English term.

#include <regex>
#include "sim/commands/help_commands.h"
#include "sim/report/key_reference.h"
#include "sim/scene/scene_fields.h"
#include "tests/sim/scene_folder.h"
#include "tests/test.h"

namespace abbe::sim {
namespace {

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

/// The tables of keys in the documents are what the program reads. ABBE_WRITE_KEYS=1 writes them.
namespace abbe::sim {
namespace {

const std::string begin_mark = "<!-- keys: ", end_mark = "<!-- end of keys -->";

std::vector<std::string> words_of_line(const std::string& line) {
  std::istringstream in(line);
  std::vector<std::string> words;
  for (std::string word; in >> word;)
    if (word != "-->") words.push_back(word);
  return words;
}

/// Sections that have a table of their own in a document.
std::set<std::string> sections_of(const std::string& document) {
  std::set<std::string> sections;
  for (std::size_t at = 0; (at = document.find(begin_mark, at)) != std::string::npos;) {
    at += begin_mark.size();
    for (const std::string& word : words_of_line(document.substr(at, document.find('\n', at) - at)))
      sections.insert(word);
  }
  return sections;
}

/// A cell of a Markdown table.
std::string cell(std::string text) {
  for (std::size_t at = 0; (at = text.find('|', at)) != std::string::npos; at += 2)
    text.insert(at, "\\");
  return text;
}

bool stands_elsewhere(const std::string& path, const std::string& section,
                      const std::set<std::string>& sections) {
  for (const std::string& other : sections)
    if (other != section && other.starts_with(section == "scene" ? "" : section + ".") &&
        path.starts_with(other + "."))
      return true;
  return false;
}

/// Keys that stand in a table of their own under another name.
bool stands_as_another_section(const std::string& path) {
  return path.starts_with("belief.identified.") || path.starts_with("belief.force.compliance.");
}

std::string table_of(const std::string& section, const std::set<std::string>& sections,
                     const std::vector<Key>& all) {
  const bool top = section == "scene" || section == "study";
  const std::string prefix = section == "scene" ? "" : section;
  const std::vector<Key> keys = top && section == "scene" ? all : keys_at(all, section);
  EXPECT_FALSE(keys.empty()) << section;
  std::string rows;
  for (const KeyRow& row : key_rows(keys, prefix)) {
    if (stands_elsewhere(row.path, section, sections) || stands_as_another_section(row.path))
      continue;
    if (section == "scene" && row.path.find('.') != std::string::npos) continue;
    const std::string name = prefix.empty() ? row.path : row.path.substr(prefix.size() + 1);
    std::string key = "`" + name + "`";
    if (row.required) key = "**" + key + "**";
    if (!row.condition.empty()) key += " with `" + row.condition + "`";
    rows += "| " + key + " | " + cell(row.value) + " | " + cell(row.default_value) + " | " +
            cell(row.description) + " |\n";
  }
  return rows;
}

std::string correction_tables(const std::vector<std::string>& sections, const std::string& document,
                              const std::vector<Key>& all) {
  std::string text;
  for (const std::string& section : sections) {
    if (sections.size() > 1) {
      const std::size_t dot = section.rfind('.');
      const std::string name = dot == std::string::npos ? section : section.substr(dot + 1);
      const std::vector<KeyRow> own = matching_key_rows(all, section);
      text += "**`" + name + "`**: " + own.front().description + "\n\n";
    }
    text += "| key | value | default | description |\n|---|---|---|---|\n" +
            table_of(section, sections_of(document), all) + "\n";
  }
  text.pop_back();
  return text;
}

/// The document with its tables made again.
std::string made_again(const std::string& document, const std::vector<Key>& all) {
  std::string out;
  std::size_t at = 0;
  while (true) {
    const std::size_t begin = document.find(begin_mark, at);
    if (begin == std::string::npos) return out + document.substr(at);
    const std::size_t line_end = document.find('\n', begin);
    const std::size_t end = document.find(end_mark, begin);
    out += document.substr(at, line_end + 1 - at);
    out += correction_tables(words_of_line(document.substr(begin + begin_mark.size(),
                                                           line_end - begin - begin_mark.size())),
                             document, all);
    at = end;
  }
}

TEST(KeyTables, OfTheDocumentsAreThoseOfTheProgram) {
  const std::vector<Key> all = all_keys();
  for (const char* name : {"scenes/README.md", "scenes/studies/README.md"}) {
    const fs::path file = fs::path(ABBE_SOURCE_DIR) / name;
    const std::string document = bytes(file), again = made_again(document, all);
    EXPECT_GT(sections_of(document).size(), 3u) << name;
    if (std::getenv("ABBE_WRITE_KEYS")) std::ofstream(file) << again;
    EXPECT_EQ(document == again, true)
        << name << " is stale; ABBE_WRITE_KEYS=1 sim_test --gtest_filter=KeyTables* writes it";
  }
}

TEST(KeyTables, EverySectionOfASceneHasATable) {
  const std::set<std::string> sections =
      sections_of(bytes(fs::path(ABBE_SOURCE_DIR) / "scenes/README.md"));
  for (const Key& key : scene_keys())
    if (!key.keys.empty() && key.name != "history" && key.name != "room") {
      EXPECT_TRUE(sections.count(key.name)) << key.name;
    }
}

TEST(KeyTables, EveryKeyHasASentence) {
  for (const KeyRow& row : key_rows(all_keys()))
    EXPECT_FALSE(row.description.empty() && row.path.find('=') == std::string::npos) << row.path;
}

}  // namespace
}  // namespace abbe::sim
