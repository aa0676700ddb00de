#pragma once

#include <filesystem>
#include <string>
#include <utility>
#include <vector>

#include <Eigen/Core>
#include <nlohmann/json.hpp>

/// Blocks of a page that render/report/charts.js draws. A label is a text, { label: key }, or a
/// list of both; a figure is a number, null, or { value, low, high } with its 95 % confidence
/// interval.
namespace abbe::sim {

using PageText = nlohmann::ordered_json;

/// Returns a label by its key; the page shows its text in the selected language.
PageText label_text(const std::string& key);
/// Returns several texts and labels joined.
/// @param words  texts and labels
PageText phrase(const std::vector<PageText>& words);

/// Returns the figure unchanged.
/// @throws std::invalid_argument if it is not a figure
const nlohmann::ordered_json& figure_in(const nlohmann::ordered_json& json);

/// Returns a block with the members that all blocks have.
/// @param group  group of which one block at a time is shown; empty: always shown
nlohmann::ordered_json page_block(const std::string& type, const std::string& id,
                                  const PageText& title, const std::string& group = {});

/// A column of a table.
struct PageColumn {
  PageText head;
  std::string unit;
};
/// Returns a table.
/// @param rows  array of arrays of labels and figures
nlohmann::ordered_json table_block(const std::string& id, const PageText& title,
                                   const std::vector<PageColumn>& columns,
                                   const nlohmann::ordered_json& rows,
                                   const std::string& group = {});

/// Returns a block of PNG files of a folder, named by their paths in it, of which one is shown at a
/// time; null if there are none.
/// @throws BadInput for a file that cannot be read
nlohmann::ordered_json pictures_block(const std::string& id, const PageText& title,
                                      const std::filesystem::path& folder,
                                      const std::vector<std::filesystem::path>& files);

/// Readings that a panel draws: one in `every`, so that at most `most` are drawn.
struct ReadingSubset {
  Eigen::Index every = 1;
  PageText title;  ///< of the panel, with ", readings 1000 / 3000" if not all are drawn
};
/// Returns the readings to draw of `count`, at most `most`.
ReadingSubset reading_subset(const std::string& title, Eigen::Index count, Eigen::Index most);

/// Returns a line or points of a panel.
/// @param mark  "line", "points" or "both"
nlohmann::ordered_json series_of(const PageText& name, const nlohmann::ordered_json& x,
                                 const nlohmann::ordered_json& y, const std::string& mark);

/// A file that can be saved from a page.
struct PageFile {
  std::string name;
  std::string text;
};

/// Contents of a page of tables and charts.
struct FiguresPage {
  std::string title;
  nlohmann::ordered_json blocks = nlohmann::ordered_json::array();  ///< made by the functions above
  std::vector<std::pair<std::string, std::string>> asked;           ///< label of the request, value
  std::vector<std::string> warnings;
  std::string command;          ///< command that reproduces the results
  std::vector<PageFile> files;  ///< files that the command needs, and the complete figures
  std::string language = "en";  ///< language in which it opens, "en" or "zh"
};

/// Returns the section that closes a page: the request, warnings, versions and how to repeat it.
std::string closing_section(const FiguresPage& page);

/// Returns one self-contained page (render/report/charts.js): its blocks, then the closing section.
/// @throws std::invalid_argument naming a label that does not exist
std::string page_html(const FiguresPage& page);

}  // namespace abbe::sim
