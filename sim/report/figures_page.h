#pragma once

#include <filesystem>
#include <string>
#include <utility>
#include <vector>

#include <Eigen/Core>
#include <nlohmann/json.hpp>

/// Blocks of a page, which render/report/charts.js draws. A label is a text, an object
/// { label: key }, or a list of both. A figure is a number, null, or { value, low, high } with the
/// limits of its 95 % confidence interval.
namespace abbe::sim {

using PageText = nlohmann::ordered_json;

/// Returns a label by its key; the page shows its text in the selected language.
PageText label_text(const std::string& key);
/// Joins texts and labels to one text.
PageText phrase(const std::vector<PageText>& texts);

/// Returns the figure unchanged.
/// @throws std::invalid_argument if it is not a figure
const nlohmann::ordered_json& require_figure(const nlohmann::ordered_json& json);

/// Returns a block with the members that all blocks have.
/// @param group  group of blocks of which the page shows one at a time; empty: always shown
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

/// Returns a block of PNG files, which the page shows one at a time, named by their paths relative
/// to the folder; null without files.
/// @throws BadInput if a file cannot be read
nlohmann::ordered_json pictures_block(const std::string& id, const PageText& title,
                                      const std::filesystem::path& folder,
                                      const std::vector<std::filesystem::path>& files);

/// Readings that a panel draws.
struct ReadingSubset {
  Eigen::Index every = 1;  ///< every how many-th reading is drawn
  PageText title;          ///< of the panel, with ", readings 1000 / 3000" if not all are drawn
};
/// Returns an even subset of `count` readings with at most `max_count` of them.
ReadingSubset reading_subset(const std::string& title, Eigen::Index count, Eigen::Index max_count);

/// Returns a series of a panel.
/// @param mark  "line", "points" or "both"
nlohmann::ordered_json chart_series(const PageText& name, const nlohmann::ordered_json& x,
                                    const nlohmann::ordered_json& y, const std::string& mark);

/// A file that a page offers for download.
struct PageFile {
  std::string name;
  std::string text;
};

/// Contents of a page of tables and charts.
struct FiguresPage {
  std::string title;
  nlohmann::ordered_json blocks = nlohmann::ordered_json::array();  ///< made by the functions above
  std::vector<std::pair<std::string, std::string>> request;         ///< label of the request, value
  std::vector<std::string> warnings;
  std::string command;          ///< command that reproduces the results
  std::vector<PageFile> files;  ///< input files of the command, and the complete figures
  std::string language = "en";  ///< language in which it opens, "en" or "zh"
};

/// Returns the last section of a page: request, warnings, versions, and the command that reproduces
/// the results.
std::string closing_section(const FiguresPage& page);

/// Returns the contents of the files that exist.
/// @throws BadInput if one of them cannot be read
std::vector<PageFile> page_files(const std::vector<std::filesystem::path>& files);

/// Returns title, request, warnings, command and blocks of a page as JSON.
nlohmann::ordered_json to_json(const FiguresPage& page);

/// Returns a page that a command of abbe saved as JSON. A warning names each of the files that was
/// changed after abbe wrote it.
/// @param files  for download; those that do not exist are left out
/// @throws BadInput naming the file if it does not exist or is not such a page, or has an unknown
/// label or a value that is not a figure
FiguresPage read_page(const std::filesystem::path& file,
                      const std::vector<std::filesystem::path>& files);

/// Returns one self-contained page (render/report/charts.js): its blocks, then the closing section.
/// @throws std::invalid_argument naming a label that does not exist
std::string page_html(const FiguresPage& page);

}  // namespace abbe::sim
