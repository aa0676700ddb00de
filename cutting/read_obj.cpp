#include "cutting/read_obj.h"

#include <algorithm>
#include <array>
#include <cstdint>
#include <utility>

#include <fmt/format.h>

#include "cutting/mesh_words.h"

namespace abbe::cutting {

namespace {

int obj_index(const Words& words, Word word, std::size_t vertices) {
  const std::string_view whole = word.text;
  word.text = whole.substr(0, whole.find('/'));
  const auto count = static_cast<std::int64_t>(vertices);
  const std::int64_t i =
      words.integer(word, -count, count, "the number of a vertex that stands above, not 0");
  if (i == 0) words.refuse("the number of a vertex that stands above, not 0", word);
  return static_cast<int>(i > 0 ? i - 1 : count + i);
}

}  // namespace

Soup read_obj(const MeshSource& source) {
  static constexpr std::array ignored = {"vt", "vn", "g", "o", "s", "usemtl", "mtllib", "l", "p"};
  Words words(source, '#');
  Soup soup;
  while (!words.at_end()) {
    const Word word = words.next();
    if (word.text == "v") {
      soup.points.push_back(words.point());
      words.skip_line();
    } else if (word.text == "f") {
      Polygon face{{}, word.line};
      Word corner = words.next_in_line();
      for (; face.corners.size() < 3 || !corner.text.empty(); corner = words.next_in_line()) {
        if (face.corners.size() == most_corners)
          words.refuse(fmt::format("at most {} corners of a face", most_corners), corner);
        face.corners.push_back(obj_index(words, corner, soup.points.size()));
      }
      soup = with_face(std::move(soup), face, source);
    } else if (std::find(ignored.begin(), ignored.end(), word.text) != ignored.end()) {
      words.skip_line();
    } else {
      words.refuse("an OBJ keyword (v, vt, vn, f, g, o, s, l, p, usemtl, mtllib)", word);
    }
  }
  return soup;
}

}  // namespace abbe::cutting
