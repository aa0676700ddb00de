#include "cutting/read_off.h"

#include <cstdint>
#include <utility>

#include <fmt/format.h>

#include "cutting/mesh_words.h"

namespace abbe::cutting {

Soup read_off(const MeshSource& source) {
  Words words(source, '#');
  const Word magic = words.next();
  if (magic.text != "OFF")
    words.refuse("'OFF' (plain text, points without colours or normals)", magic);
  // every vertex and face takes at least six bytes, so the counts are bounded by the file
  const auto most = static_cast<std::int64_t>(words.bytes_left() / 6);
  const std::int64_t vertices =
      words.integer(words.next(), 0, most, "number of vertices that fit the file");
  const std::int64_t faces =
      words.integer(words.next(), 0, most, "number of faces that fit the file");
  words.integer(words.next(), 0, std::int64_t{1} << 40, "number of edges");
  source.check_triangles(faces);
  Soup soup;
  for (std::int64_t i = 0; i < vertices; ++i) soup.points.push_back(words.point());
  for (std::int64_t i = 0; i < faces; ++i) {
    const Word word = words.next();
    Polygon face{{}, word.line};
    face.corners.resize(std::size_t(words.integer(word, 3, most_corners, "number of corners")));
    for (int& corner : face.corners)
      corner = static_cast<int>(words.integer(words.next(), 0, vertices - 1, "number of a vertex"));
    soup = with_face(std::move(soup), face, source);
    words.skip_line();  // a colour may follow
  }
  if (!words.at_end())
    words.refuse("the end of the file after the faces of its header", words.next());
  return soup;
}

}  // namespace abbe::cutting
