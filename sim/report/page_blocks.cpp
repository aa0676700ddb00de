#include "sim/report/page_blocks.h"

#include <algorithm>
#include <stdexcept>

#include <fmt/format.h>

#include "kinematics/text.h"
#include "sim/report/encode.h"
#include "sim/report/saved_json.h"

namespace abbe::sim {

using nlohmann::ordered_json;

PageWord label_word(const std::string& key) {
  PageWord word = PageWord::object();
  word["label"] = key;
  return word;
}

PageWord phrase(const std::vector<PageWord>& words) {
  PageWord list = PageWord::array();
  for (const PageWord& one : words) list.push_back(one);
  return list;
}

const ordered_json& figure_in(const ordered_json& json) {
  const auto is_number = [](const ordered_json& one) { return one.is_number() || one.is_null(); };
  const bool is_banded = json.is_object() && json.size() == 3 && json.contains("value") &&
                         json.contains("low") && json.contains("high") &&
                         std::all_of(json.begin(), json.end(), is_number);
  if (!is_number(json) && !is_banded)
    throw std::invalid_argument("no figure: " + json.dump().substr(0, 60));
  return json;
}

ordered_json page_block(const std::string& type, const std::string& id, const PageWord& title,
                        const std::string& group) {
  ordered_json block{{"type", type}, {"id", id}, {"title", title}};
  if (!group.empty()) block["group"] = group;
  return block;
}

ordered_json table_block(const std::string& id, const PageWord& title,
                         const std::vector<PageColumn>& columns, const ordered_json& rows,
                         const std::string& group) {
  ordered_json block = page_block("table", id, title, group);
  block["columns"] = ordered_json::array();
  for (const PageColumn& one : columns)
    block["columns"].push_back({{"head", one.head}, {"unit", one.unit}});
  block["rows"] = rows;
  return block;
}

ordered_json pictures_block(const std::string& id, const PageWord& title,
                            const std::filesystem::path& folder,
                            const std::vector<std::filesystem::path>& files) {
  if (files.empty()) return {};
  ordered_json block = page_block("pictures", id, title);
  block["pictures"] = ordered_json::array();
  for (const std::filesystem::path& file : files) {
    std::filesystem::path name = std::filesystem::relative(file, folder);
    ordered_json one;
    one["name"] = name.replace_extension().generic_string();
    one["src"] = "data:image/png;base64," + base64(read_text(file, most_saved_bytes));
    block["pictures"].push_back(one);
  }
  return block;
}

ReadingsDrawn readings_drawn(const std::string& title, Eigen::Index count, Eigen::Index most) {
  ReadingsDrawn drawn{std::max<Eigen::Index>(1, (count + most - 1) / most), title};
  if (drawn.every > 1)
    drawn.title = phrase({title + ", ", label_word("readings"),
                          fmt::format(" {} / {}", (count - 1) / drawn.every + 1, count)});
  return drawn;
}

ordered_json series_of(const PageWord& name, const ordered_json& x, const ordered_json& y,
                       const std::string& mark) {
  ordered_json series;
  series["name"] = name;
  series["x"] = x;
  series["y"] = y;
  series["mark"] = mark;
  return series;
}

}  // namespace abbe::sim
