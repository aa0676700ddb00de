#include <gtest/gtest.h>

#include <cstdlib>
#include <fstream>
#include <set>
#include <sstream>

#include "sim/commands/help_commands.h"
#include "sim/report/key_reference.h"
#include "sim/scene/scene_fields.h"
#include "tests/sim/scene_folder.h"

/// The tables of keys in the documents are what the program reads. ABBE_WRITE_KEYS=1 writes them.
namespace abbe::sim {
namespace {

namespace fs = std::filesystem;

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
    rows += "| " + key + " | " + cell(row.value) + " | " + cell(row.fallback) + " | " +
            cell(row.sentence) + " |\n";
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
      text += "**`" + name + "`**: " + own.front().sentence + "\n\n";
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
    EXPECT_FALSE(row.sentence.empty() && row.path.find('=') == std::string::npos) << row.path;
}

}  // namespace
}  // namespace abbe::sim
