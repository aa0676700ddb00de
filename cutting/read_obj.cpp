#include "cutting/read_obj.h"

#include <algorithm>
#include <array>
#include <cstdint>
#include <map>
#include <optional>
#include <set>
#include <string>
#include <system_error>
#include <utility>

#include <fmt/format.h>

#include "cutting/face_marker.h"
#include "cutting/mesh_words.h"
#include "cutting/read_mtl.h"
#include "kinematics/text.h"

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

Polygon obj_face(Words& words, int line, std::size_t vertices) {
  Polygon face{{}, line};
  Word corner = words.next_in_line();
  for (; face.corners.size() < 3 || !corner.text.empty(); corner = words.next_in_line()) {
    if (face.corners.size() == most_corners)
      words.refuse(fmt::format("at most {} corners of a face", most_corners), corner);
    face.corners.push_back(obj_index(words, corner, vertices));
  }
  return face;
}

/// The file of a name beside an OBJ; exporters write the folder on which they wrote it, with either
/// kind of slash.
std::filesystem::path beside_obj(const std::string& obj, std::string_view name) {
  const std::size_t slash = name.find_last_of("/\\");
  if (slash != std::string_view::npos) name.remove_prefix(slash + 1);
  return std::filesystem::path(obj).parent_path() / std::string(name);
}

bool is_file(const std::filesystem::path& file) {
  std::error_code failure;
  return std::filesystem::is_regular_file(file, failure);
}

/// The files of a `mtllib`: the whole line, where a file has blanks in its name, or its words.
std::vector<std::pair<std::filesystem::path, Word>> libraries(Words& words,
                                                              const std::string& obj) {
  const Word line = words.rest_of_line();
  if (is_file(beside_obj(obj, line.text))) return {{beside_obj(obj, line.text), line}};
  std::vector<std::pair<std::filesystem::path, Word>> files;
  for (const Cell& cell : cells_of(line.text, ' ', line.text.size())) {
    const Word word{cell.text, line.line, line.column + cell.column - 1};
    if (!cell.text.empty()) files.emplace_back(beside_obj(obj, cell.text), word);
  }
  return files;
}

/// The marks of the faces to come.
class ObjMarks {
 public:
  ObjMarks(const MeshSource& source, const WantedMarks& wanted)
      : source_(source), wanted_(wanted), marker_(source) {}

  /// Takes a line that says something of faces. @return whether it was one
  bool take(Words& words, const Word& keyword) {
    if (keyword.text == "g" && wanted_.groups)
      group_ = group_of(words);
    else if (keyword.text == "o" && wanted_.groups)
      object_ = named(words.rest_of_line());
    else if (keyword.text == "usemtl" && wanted_.any())
      use_material(words, words.rest_of_line());
    else if (keyword.text == "mtllib" && wanted_.colours)
      add_libraries(words);
    else
      return false;
    changed_ = true;
    return true;
  }

  void mark(std::size_t faces) {
    if (!wanted_.any()) return;
    if (std::exchange(changed_, false)) {
      mark_ = {{}, colour_};
      for (const int names : {group_, object_, material_})
        if (names >= 0) mark_.names.push_back(names);
    }
    marker_.mark(faces, mark_);
  }
  const FaceMarks& marks() const { return marker_.marks(); }

 private:
  int named(const Word& name) {
    return name.text.empty() ? -1 : marker_.set_of({std::string(name.text)});
  }

  int group_of(Words& words) {
    const Word line = words.rest_of_line();
    std::vector<std::string> names;
    for (const Cell& cell : cells_of(line.text, ' ', line.text.size()))
      if (!cell.text.empty()) names.emplace_back(cell.text);
    if (names.size() > 1) names.emplace_back(line.text);  // one name with blanks in it
    if (names.empty()) names.emplace_back("default");
    return marker_.set_of(names);
  }

  void use_material(const Words& words, const Word& name) {
    if (wanted_.groups) material_ = named(name);
    if (!wanted_.colours) return;
    const auto found = materials_.find(std::string(name.text));
    if (found == materials_.end())
      words.refuse(any_library_ ? "a material of a library (mtllib) above"
                                : "mtllib above, a library that has the colour of the material",
                   name);
    colour_ = found->second;
  }

  void add_libraries(Words& words) {
    for (const auto& [file, word] : libraries(words, source_.name)) {
      any_library_ = true;
      if (!read_.emplace(file.string()).second) continue;
      if (!is_file(file))
        words.refuse(fmt::format("the file {} beside the OBJ, for the colours of its faces",
                                 file.filename().string()),
                     word);
      for (auto& [name, colour] : read_mtl(file))
        if (!materials_.emplace(name, colour).second)
          words.refuse(fmt::format("libraries that do not both have the material {}", shown(name)),
                       word);
    }
  }

  const MeshSource& source_;
  WantedMarks wanted_;
  FaceMarker marker_;
  Materials materials_;
  std::set<std::string> read_;
  bool any_library_ = false;
  int group_ = -1, object_ = -1, material_ = -1;  // sets of names
  std::optional<FaceColour> colour_;
  FaceMark mark_;
  bool changed_ = true;
};

}  // namespace

Soup read_obj(const MeshSource& source, const WantedMarks& wanted) {
  // texture, groups, display and smoothing; free-form geometry is not among them
  static constexpr std::array ignored = {"vt",       "vn",  "vp",         "g",        "o",
                                         "s",        "mg",  "usemtl",     "mtllib",   "usemap",
                                         "maplib",   "l",   "p",          "bevel",    "c_interp",
                                         "d_interp", "lod", "shadow_obj", "trace_obj"};
  Words words(source, '#');
  Soup soup;
  ObjMarks marks(source, wanted);
  while (!words.at_end()) {
    const Word word = words.next();
    if (word.text == "v") {
      soup.points.push_back(words.point());
      words.skip_line();
    } else if (word.text == "f") {
      soup = with_face(std::move(soup), obj_face(words, word.line, soup.points.size()), source);
      marks.mark(soup.faces.size());
    } else if (marks.take(words, word)) {
      continue;
    } else if (std::find(ignored.begin(), ignored.end(), word.text) != ignored.end()) {
      words.skip_line();
    } else {
      words.refuse("an OBJ keyword (v, vt, vn, f, g, o, s, l, p, usemtl, mtllib)", word);
    }
  }
  soup.marks = marks.marks();
  return soup;
}

std::vector<std::filesystem::path> material_files(const std::filesystem::path& file,
                                                  std::uintmax_t max_bytes) {
  const MeshSource source = mesh_source(file, max_bytes, 0);
  Words words(source, '#');
  std::vector<std::filesystem::path> files;
  while (!words.at_end()) {
    if (words.next().text == "mtllib")
      for (const auto& [library, word] : libraries(words, source.name))
        if (is_file(library) && std::ranges::find(files, library) == files.end())
          files.push_back(library);
    words.skip_line();
  }
  return files;
}

}  // namespace abbe::cutting
