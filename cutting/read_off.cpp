#include "cutting/read_off.h"

#include <cmath>
#include <cstdint>
#include <optional>
#include <string_view>
#include <utility>
#include <vector>

#include <fmt/format.h>

#include "cutting/face_marker.h"
#include "cutting/mesh_words.h"

namespace abbe::cutting {
namespace {

/// Whether channels are 0 .. 255. Writers leave out the point of a fraction that has none, and
/// nobody paints with a single 255th: 1 0 0 is red.
bool of_255(const std::vector<Word>& channels) {
  bool above_one = false;
  for (const Word& word : channels) {
    if (word.text.find_first_not_of("+-0123456789") != std::string_view::npos) return false;
    above_one = above_one || (word.text != "0" && word.text != "1");
  }
  return above_one;
}

/// The colour that ends a line; none where nothing does.
std::optional<FaceColour> off_colour(Words& words) {
  std::vector<Word> channels;
  for (Word word = words.next_in_line(); !word.text.empty(); word = words.next_in_line()) {
    if (channels.size() == 4) words.refuse("the end of the line after a colour", word);
    channels.push_back(word);
  }
  if (channels.empty()) return std::nullopt;
  if (channels.size() < 3)
    words.refuse(
        "a colour of three or four numbers, or none (an index into a map of colours that "
        "the file does not have is none)",
        channels.front());
  const bool whole = of_255(channels);
  FaceColour colour{{0, 0, 0},
                    whole ? FaceColour::Digits::EightBits : FaceColour::Digits::Fraction};
  for (std::size_t k = 0; k < 3; ++k) {
    const double value =
        whole ? double(words.integer(channels[k], 0, 255, "a channel")) : words.number(channels[k]);
    if (!whole && !(value >= 0.0 && value <= 1.0))
      words.refuse("a channel from 0 to 1, or all as whole numbers from 0 to 255", channels[k]);
    colour.channels[k] = whole ? int(value) : int(std::lround(255.0 * value));
  }
  return colour;
}

}  // namespace

Soup read_off(const MeshSource& source, const WantedMarks& wanted) {
  Words words(source, '#');
  const Word magic = words.next();
  // ST texture, C colours, N normals of the vertices, behind their places
  std::string_view kind = magic.text;
  const auto has = [&](std::string_view what) {
    const bool is = kind.starts_with(what) && kind != "OFF";
    if (is) kind.remove_prefix(what.size());
    return is;
  };
  const bool texture = has("ST"), of_vertices = has("C"), normals = has("N");
  if (kind != "OFF") words.refuse("'OFF', with ST, C and N before it or not", magic);
  if (texture && of_vertices && wanted.colours)
    words.refuse("'COFF' or 'CNOFF', colours that no texture follows", magic);
  // every vertex and face takes at least six bytes, so the counts are bounded by the file
  const auto most = static_cast<std::int64_t>(words.bytes_left() / 6);
  const std::int64_t vertices =
      words.integer(words.next(), 0, most, "number of vertices that fit the file");
  const std::int64_t faces =
      words.integer(words.next(), 0, most, "number of faces that fit the file");
  words.integer(words.next(), 0, std::int64_t{1} << 40, "number of edges");
  source.check_triangles(faces);
  Soup soup;
  FaceMarker marker(source);
  std::vector<std::optional<FaceColour>> colours;  // of the vertices
  for (std::int64_t i = 0; i < vertices; ++i) {
    soup.points.push_back(words.point());
    for (int k = 0; normals && k < 3; ++k) words.next_in_line();
    if (of_vertices && wanted.colours && !texture) colours.push_back(off_colour(words));
    if (of_vertices || normals || texture) words.skip_line();
  }
  for (std::int64_t i = 0; i < faces; ++i) {
    const Word word = words.next();
    Polygon face{{}, word.line};
    face.corners.resize(std::size_t(words.integer(word, 3, most_corners, "number of corners")));
    for (int& corner : face.corners)
      corner = static_cast<int>(words.integer(words.next(), 0, vertices - 1, "number of a vertex"));
    soup = with_face(std::move(soup), face, source);
    if (wanted.colours) {
      std::optional<FaceColour> colour = off_colour(words);
      if (!colour) colour = colour_of_corners(colours, face.corners);
      marker.mark(soup.faces.size(), {{}, colour});
    }
    words.skip_line();  // a colour may follow
  }
  soup.marks = marker.marks();
  if (!words.at_end())
    words.refuse("the end of the file after the faces of its header", words.next());
  return soup;
}

}  // namespace abbe::cutting
