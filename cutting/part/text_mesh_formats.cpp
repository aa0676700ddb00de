#include "cutting/part/text_mesh_formats.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>
#include <filesystem>
#include <map>
#include <optional>
#include <set>
#include <string>
#include <string_view>
#include <system_error>
#include <utility>
#include <vector>

#include <fmt/format.h>

#include "cutting/part/mesh.h"
#include "cutting/part/mesh_file.h"
#include "kinematics/text.h"

namespace abbe::cutting {

inline constexpr std::size_t max_mtl_bytes = std::size_t{16} << 20;

/// Materials by name with their diffuse colour; nothing for a material without one.
using Materials = std::map<std::string, std::optional<FaceColour>>;

/// Reads the materials of a Wavefront MTL and their `Kd r g b`, 0 .. 1. Other properties are
/// skipped, but their keywords must be known.
/// @throws BadInput for anything else, for a duplicate name, and for a file of more than
///         `max_mtl_bytes`
Materials read_mtl(const std::filesystem::path& file);

namespace {

bool is_passed_over(std::string_view keyword) {
  static constexpr std::array known = {
      "ka",     "ks",   "ke",   "km",    "kt",   "tf",   "illum",     "d",         "tr",
      "ns",     "ni",   "pr",   "pm",    "ps",   "pc",   "pcr",       "refl",      "aniso",
      "anisor", "bump", "disp", "decal", "norm", "halo", "sharpness", "roughness", "metallic"};
  const std::string small = lower(keyword);
  return small.starts_with("map_") || std::ranges::find(known, small) != known.end();
}

/// Returns the colour of `Kd r g b` or `Kd r`.
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

namespace {

// Returns the index of a corner; negative numbers count backwards from the last vertex.
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
    if (face.corners.size() == max_corners)
      words.refuse(fmt::format("at most {} corners of a face", max_corners), corner);
    face.corners.push_back(obj_index(words, corner, vertices));
  }
  return face;
}

/// Returns the path of a named file beside an OBJ. Exporters write the folder on their own machine,
/// with either kind of slash, so only the last component is used.
std::filesystem::path beside_obj(const std::string& obj, std::string_view name) {
  const std::size_t slash = name.find_last_of("/\\");
  if (slash != std::string_view::npos) name.remove_prefix(slash + 1);
  return std::filesystem::path(obj).parent_path() / std::string(name);
}

bool is_file(const std::filesystem::path& file) {
  std::error_code failure;
  return std::filesystem::is_regular_file(file, failure);
}

/// Returns the files of a `mtllib`: the whole line if such a file exists, since names may contain
/// blanks, otherwise each of its tokens.
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

/// The marks that apply to the next faces.
class ObjMarks {
 public:
  ObjMarks(const MeshSource& source, const MarkSelection& wanted)
      : source_(source), wanted_(wanted), marker_(source) {}

  /// Reads a line that changes the marks. @return false if the line is of another kind
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
    if (names.size() > 1) names.emplace_back(line.text);  // a single name that contains blanks
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
  MarkSelection wanted_;
  FaceMarkCollector marker_;
  Materials materials_;
  std::set<std::string> read_;
  bool any_library_ = false;
  int group_ = -1, object_ = -1, material_ = -1;  // sets of names
  std::optional<FaceColour> colour_;
  FaceMark mark_;
  bool changed_ = true;
};

}  // namespace

TriangleSoup read_obj(const MeshSource& source, const MarkSelection& wanted) {
  // Texture, groups, display and smoothing; free-form geometry is not among them.
  static constexpr std::array ignored = {"vt",       "vn",  "vp",         "g",        "o",
                                         "s",        "mg",  "usemtl",     "mtllib",   "usemap",
                                         "maplib",   "l",   "p",          "bevel",    "c_interp",
                                         "d_interp", "lod", "shadow_obj", "trace_obj"};
  Words words(source, '#');
  TriangleSoup soup;
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

namespace {

/// Returns true if channels are on the scale 0 .. 255. Writers omit the decimal point of whole
/// fractions, and a channel of a single 255th does not occur in practice: 1 0 0 is red.
bool of_255(const std::vector<Word>& channels) {
  bool above_one = false;
  for (const Word& word : channels) {
    if (word.text.find_first_not_of("+-0123456789") != std::string_view::npos) return false;
    above_one = above_one || (word.text != "0" && word.text != "1");
  }
  return above_one;
}

/// Returns the colour at the end of a line; nothing if the line has ended.
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

TriangleSoup read_off(const MeshSource& source, const MarkSelection& wanted) {
  Words words(source, '#');
  const Word magic = words.next();
  // ST: texture, C: colours, N: normals of the vertices; they follow the coordinates.
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
  // Every vertex and face takes at least six bytes, so the size of the file bounds the counts.
  const auto most = static_cast<std::int64_t>(words.bytes_left() / 6);
  const std::int64_t vertices =
      words.integer(words.next(), 0, most, "number of vertices that fit the file");
  const std::int64_t faces =
      words.integer(words.next(), 0, most, "number of faces that fit the file");
  // The number of edges is not needed, and many writers put 0.
  words.integer(words.next(), 0, std::int64_t{1} << 40, "number of edges");
  source.check_triangles(faces);
  TriangleSoup soup;
  FaceMarkCollector marker(source);
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
    face.corners.resize(std::size_t(words.integer(word, 3, max_corners, "number of corners")));
    for (int& corner : face.corners)
      corner = static_cast<int>(words.integer(words.next(), 0, vertices - 1, "number of a vertex"));
    soup = with_face(std::move(soup), face, source);
    if (wanted.colours) {
      std::optional<FaceColour> colour = off_colour(words);
      if (!colour) colour = common_corner_colour(colours, face.corners);
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
