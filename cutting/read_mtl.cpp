#include "cutting/read_mtl.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <string_view>

#include <fmt/format.h>

#include "cutting/mesh_words.h"
#include "kinematics/text.h"

namespace abbe::cutting {
namespace {

bool is_passed_over(std::string_view keyword) {
  static constexpr std::array known = {
      "ka",     "ks",   "ke",   "km",    "kt",   "tf",   "illum",     "d",         "tr",
      "ns",     "ni",   "pr",   "pm",    "ps",   "pc",   "pcr",       "refl",      "aniso",
      "anisor", "bump", "disp", "decal", "norm", "halo", "sharpness", "roughness", "metallic"};
  const std::string small = lower(keyword);
  return small.starts_with("map_") || std::ranges::find(known, small) != known.end();
}

/// Of `Kd r g b`, or `Kd r`.
FaceColour diffuse(Words& words, const Word& keyword) {
  FaceColour colour{{0, 0, 0}, FaceColour::Digits::Fraction};
  int count = 0;
  for (Word word = words.next_in_line(); !word.text.empty(); word = words.next_in_line()) {
    if (count == 0 && (word.text == "spectral" || word.text == "xyz"))
      words.refuse("a colour as red, green and blue", word);
    const double value = words.number(word);
    if (count == 3) words.refuse("three numbers of a colour and the end of the line", word);
    if (!(value >= 0.0 && value <= 1.0)) words.refuse("a channel from 0 to 1", word);
    colour.channels[std::size_t(count++)] = int(std::lround(255.0 * value));
  }
  if (count == 1) colour.channels.fill(colour.channels[0]);
  if (count != 1 && count != 3)
    words.refuse(fmt::format("one or three numbers after it, not {}", count), keyword);
  return colour;
}

}  // namespace

Materials read_mtl(const std::filesystem::path& file) {
  const MeshSource source{file.string(), read_text(file, max_mtl_bytes), 0};
  Words words(source, '#');
  Materials materials;
  std::optional<FaceColour>* colour = nullptr;
  while (!words.at_end()) {
    const Word keyword = words.next();
    if (keyword.text == "newmtl") {
      const Word name = words.rest_of_line();
      if (name.text.empty()) words.refuse("the name of a material after newmtl", name);
      const auto [place, is_new] = materials.emplace(std::string(name.text), std::nullopt);
      if (!is_new) words.refuse("a name that no material above has", name);
      colour = &place->second;
    } else if (keyword.text == "Kd") {
      if (colour == nullptr) words.refuse("newmtl before the colour of a material", keyword);
      if (*colour) words.refuse("one Kd of a material", keyword);
      *colour = diffuse(words, keyword);
    } else if (is_passed_over(keyword.text)) {
      words.skip_line();
    } else {
      words.refuse("a keyword of MTL (newmtl, Kd, Ka, Ks, Ns, d, illum, map_Kd ...)", keyword);
    }
  }
  return materials;
}

}  // namespace abbe::cutting
