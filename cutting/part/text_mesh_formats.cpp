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

namespace {

constexpr std::size_t max_mtl_bytes = std::size_t{16} << 20;

/// Materials by name with their diffuse colour; empty for a material without one.
using Materials = std::map<std::string, std::optional<FaceColour>>;

/// Returns true for a keyword of MTL whose line is skipped.
bool is_ignored_keyword(std::string_view keyword) {
  static constexpr std::array ignored_keywords = {
      "ka",     "ks",   "ke",   "km",    "kt",   "tf",   "illum",     "d",         "tr",
      "ns",     "ni",   "pr",   "pm",    "ps",   "pc",   "pcr",       "refl",      "aniso",
      "anisor", "bump", "disp", "decal", "norm", "halo", "sharpness", "roughness", "metallic"};
  const std::string lower_case_keyword = lower(keyword);
  return lower_case_keyword.starts_with("map_") ||
         std::ranges::find(ignored_keywords, lower_case_keyword) != ignored_keywords.end();
}

/// Returns the colour of `Kd r g b` or `Kd r`.
FaceColour diffuse(TokenReader& tokens, const Token& keyword) {
  FaceColour colour{{0, 0, 0}, FaceColour::ChannelFormat::Fraction};
  int count = 0;
  for (Token token = tokens.next_in_line(); !token.text.empty(); token = tokens.next_in_line()) {
    if (count == 0 && (token.text == "spectral" || token.text == "xyz"))
      tokens.refuse("a colour given as red, green and blue", token);
    const double value = tokens.number(token);
    if (count == 3) tokens.refuse("the end of the line after three colour numbers", token);
    if (!(value >= 0.0 && value <= 1.0)) tokens.refuse("a channel from 0 to 1", token);
    colour.channels[std::size_t(count++)] = int(std::lround(255.0 * value));
  }
  if (count == 1) colour.channels.fill(colour.channels[0]);
  if (count != 1 && count != 3)
    tokens.refuse(fmt::format("one or three numbers after the keyword, not {}", count), keyword);
  return colour;
}

/// Reads the materials of a Wavefront MTL and their `Kd r g b`, 0 .. 1. Other properties are
/// skipped, but their keywords must be known.
/// @throws BadInput for other content, a duplicate name, or a file of more than `max_mtl_bytes`
Materials read_mtl(const std::filesystem::path& file) {
  const MeshSource source{file.string(), read_text(file, max_mtl_bytes), 0};
  TokenReader tokens(source, '#');
  Materials materials;
  std::optional<FaceColour>* colour = nullptr;
  while (!tokens.at_end()) {
    const Token keyword = tokens.next();
    if (keyword.text == "newmtl") {
      const Token name = tokens.remaining_line();
      if (name.text.empty()) tokens.refuse("a material name after newmtl", name);
      const auto [entry, is_new] = materials.emplace(std::string(name.text), std::nullopt);
      if (!is_new) tokens.refuse("a material name that is not yet used", name);
      colour = &entry->second;
    } else if (keyword.text == "Kd") {
      if (colour == nullptr) tokens.refuse("newmtl before the colour of a material", keyword);
      if (*colour) tokens.refuse("one Kd per material", keyword);
      *colour = diffuse(tokens, keyword);
    } else if (is_ignored_keyword(keyword.text)) {
      tokens.skip_line();
    } else {
      tokens.refuse("an MTL keyword (newmtl, Kd, Ka, Ks, Ns, d, illum, map_Kd ...)", keyword);
    }
  }
  return materials;
}

/// Returns the index of a corner; negative numbers count backwards from the last vertex.
int obj_index(const TokenReader& tokens, Token token, std::size_t vertices) {
  const std::string_view token_text = token.text;
  token.text = token_text.substr(0, token_text.find('/'));
  const auto count = static_cast<std::int64_t>(vertices);
  const std::int64_t i =
      tokens.integer(token, -count, count, "the number of a vertex defined above, not 0");
  if (i == 0) tokens.refuse("the number of a vertex defined above, not 0", token);
  return static_cast<int>(i > 0 ? i - 1 : count + i);
}

Polygon obj_face(TokenReader& tokens, int line, std::size_t vertices) {
  Polygon face{{}, line};
  Token corner = tokens.next_in_line();
  for (; face.corners.size() < 3 || !corner.text.empty(); corner = tokens.next_in_line()) {
    if (face.corners.size() == max_corners)
      tokens.refuse(fmt::format("at most {} corners per face", max_corners), corner);
    face.corners.push_back(obj_index(tokens, corner, vertices));
  }
  return face;
}

/// Returns the path of a named file in the folder of an OBJ. Exporters write the folder on their
/// own computer, with either kind of slash, so only the last component is used.
std::filesystem::path file_beside_obj(const std::string& obj, std::string_view name) {
  const std::size_t slash = name.find_last_of("/\\");
  if (slash != std::string_view::npos) name.remove_prefix(slash + 1);
  return std::filesystem::path(obj).parent_path() / std::string(name);
}

bool is_file(const std::filesystem::path& file) {
  std::error_code failure;
  return std::filesystem::is_regular_file(file, failure);
}

/// Returns the files of a `mtllib` with their tokens: the whole line if it names an existing file,
/// since names may contain blanks, otherwise each of its tokens.
std::vector<std::pair<std::filesystem::path, Token>> libraries(TokenReader& tokens,
                                                               const std::string& obj) {
  const Token line = tokens.remaining_line();
  if (is_file(file_beside_obj(obj, line.text))) return {{file_beside_obj(obj, line.text), line}};
  std::vector<std::pair<std::filesystem::path, Token>> files;
  for (const Cell& cell : split_cells(line.text, ' ', line.text.size())) {
    const Token token{cell.text, line.line, line.column + cell.column - 1};
    if (!cell.text.empty()) files.emplace_back(file_beside_obj(obj, cell.text), token);
  }
  return files;
}

/// Reader of the marks in an OBJ, which apply to the faces that follow.
class ObjMarks {
 public:
  ObjMarks(const MeshSource& source, const MarkSelection& requested_marks)
      : source_(source), requested_marks_(requested_marks), mark_collector_(source) {}

  /// Reads a line that changes the marks.
  /// @return false if the line is of another kind
  bool read_line(TokenReader& tokens, const Token& keyword) {
    if (keyword.text == "g" && requested_marks_.groups)
      group_ = group_set(tokens);
    else if (keyword.text == "o" && requested_marks_.groups)
      object_ = named_set(tokens.remaining_line());
    else if (keyword.text == "usemtl" && requested_marks_.any())
      read_material(tokens, tokens.remaining_line());
    else if (keyword.text == "mtllib" && requested_marks_.colours)
      add_libraries(tokens);
    else
      return false;
    has_changed_ = true;
    return true;
  }

  void mark(std::size_t faces) {
    if (!requested_marks_.any()) return;
    if (std::exchange(has_changed_, false)) {
      mark_ = {{}, colour_};
      for (const int names : {group_, object_, material_})
        if (names >= 0) mark_.name_set_indices.push_back(names);
    }
    mark_collector_.mark(faces, mark_);
  }
  const FaceMarks& marks() const { return mark_collector_.marks(); }

 private:
  int named_set(const Token& name) {
    return name.text.empty() ? -1 : mark_collector_.name_set_index({std::string(name.text)});
  }

  int group_set(TokenReader& tokens) {
    const Token line = tokens.remaining_line();
    std::vector<std::string> names;
    for (const Cell& cell : split_cells(line.text, ' ', line.text.size()))
      if (!cell.text.empty()) names.emplace_back(cell.text);
    if (names.size() > 1) names.emplace_back(line.text);  // a single name that contains blanks
    if (names.empty()) names.emplace_back("default");
    return mark_collector_.name_set_index(names);
  }

  void read_material(const TokenReader& tokens, const Token& name) {
    if (requested_marks_.groups) material_ = named_set(name);
    if (!requested_marks_.colours) return;
    const auto material = materials_.find(std::string(name.text));
    if (material == materials_.end())
      tokens.refuse(has_library_
                        ? "a material of a library (mtllib) named above"
                        : "mtllib before usemtl: the library holds the colour of the material",
                    name);
    colour_ = material->second;
  }

  void add_libraries(TokenReader& tokens) {
    for (const auto& [file, token] : libraries(tokens, source_.name)) {
      has_library_ = true;
      if (!files_read_.emplace(file.string()).second) continue;
      if (!is_file(file))
        tokens.refuse(fmt::format("the file {} next to the OBJ file, for its face colours",
                                  file.filename().string()),
                      token);
      for (auto& [name, colour] : read_mtl(file))
        if (!materials_.emplace(name, colour).second)
          tokens.refuse(fmt::format("one library only that defines the material {}", shown(name)),
                        token);
    }
  }

  const MeshSource& source_;
  MarkSelection requested_marks_;
  FaceMarkCollector mark_collector_;
  Materials materials_;
  std::set<std::string> files_read_;
  bool has_library_ = false;
  int group_ = -1, object_ = -1, material_ = -1;  // sets of names
  std::optional<FaceColour> colour_;
  FaceMark mark_;
  bool has_changed_ = true;
};

}  // namespace

TriangleSoup read_obj(const MeshSource& source, const MarkSelection& requested_marks) {
  // Texture, groups, display and smoothing, but not free-form geometry.
  static constexpr std::array ignored = {"vt",       "vn",  "vp",         "g",        "o",
                                         "s",        "mg",  "usemtl",     "mtllib",   "usemap",
                                         "maplib",   "l",   "p",          "bevel",    "c_interp",
                                         "d_interp", "lod", "shadow_obj", "trace_obj"};
  TokenReader tokens(source, '#');
  TriangleSoup soup;
  ObjMarks marks(source, requested_marks);
  while (!tokens.at_end()) {
    const Token token = tokens.next();
    if (token.text == "v") {
      soup.points.push_back(tokens.point());
      tokens.skip_line();
    } else if (token.text == "f") {
      soup = append_face(std::move(soup), obj_face(tokens, token.line, soup.points.size()), source);
      marks.mark(soup.faces.size());
    } else if (marks.read_line(tokens, token)) {
      continue;
    } else if (std::find(ignored.begin(), ignored.end(), token.text) != ignored.end()) {
      tokens.skip_line();
    } else {
      tokens.refuse("an OBJ keyword (v, vt, vn, f, g, o, s, l, p, usemtl, mtllib)", token);
    }
  }
  soup.marks = marks.marks();
  return soup;
}

std::vector<std::filesystem::path> material_files(const std::filesystem::path& file,
                                                  std::uintmax_t max_bytes) {
  const MeshSource source = load_mesh_source(file, max_bytes, 0);
  TokenReader tokens(source, '#');
  std::vector<std::filesystem::path> files;
  while (!tokens.at_end()) {
    if (tokens.next().text == "mtllib")
      for (const auto& [library, token] : libraries(tokens, source.name))
        if (is_file(library) && std::ranges::find(files, library) == files.end())
          files.push_back(library);
    tokens.skip_line();
  }
  return files;
}

namespace {

/// Returns true if the channels are on the scale 0 .. 255. Writers omit the decimal point of whole
/// fractions, so 1 0 0 is red: a channel of a single 255th does not occur in practice.
bool are_eight_bit(const std::vector<Token>& channels) {
  bool exceeds_one = false;
  for (const Token& token : channels) {
    if (token.text.find_first_not_of("+-0123456789") != std::string_view::npos) return false;
    exceeds_one = exceeds_one || (token.text != "0" && token.text != "1");
  }
  return exceeds_one;
}

/// Returns the colour at the end of a line; empty if the line has no more tokens.
std::optional<FaceColour> off_colour(TokenReader& tokens) {
  std::vector<Token> channels;
  for (Token token = tokens.next_in_line(); !token.text.empty(); token = tokens.next_in_line()) {
    if (channels.size() == 4) tokens.refuse("the end of the line after a colour", token);
    channels.push_back(token);
  }
  if (channels.empty()) return std::nullopt;
  if (channels.size() < 3)
    tokens.refuse(
        "a colour of three or four numbers, or no colour (an index into a colour map is not a "
        "colour)",
        channels.front());
  const bool is_eight_bit = are_eight_bit(channels);
  FaceColour colour{
      {0, 0, 0},
      is_eight_bit ? FaceColour::ChannelFormat::EightBits : FaceColour::ChannelFormat::Fraction};
  for (std::size_t k = 0; k < 3; ++k) {
    const double value = is_eight_bit ? double(tokens.integer(channels[k], 0, 255, "a channel"))
                                      : tokens.number(channels[k]);
    if (!is_eight_bit && !(value >= 0.0 && value <= 1.0))
      tokens.refuse("channels from 0 to 1, or integers from 0 to 255", channels[k]);
    colour.channels[k] = is_eight_bit ? int(value) : int(std::lround(255.0 * value));
  }
  return colour;
}

}  // namespace

TriangleSoup read_off(const MeshSource& source, const MarkSelection& requested_marks) {
  TokenReader tokens(source, '#');
  const Token magic = tokens.next();
  // Prefixes state what follows the coordinates of a vertex: ST texture, C colour, N normal.
  std::string_view format = magic.text;
  const auto strip_prefix = [&](std::string_view prefix) {
    const bool is_present = format.starts_with(prefix) && format != "OFF";
    if (is_present) format.remove_prefix(prefix.size());
    return is_present;
  };
  const bool has_texture = strip_prefix("ST"), has_vertex_colours = strip_prefix("C"),
             has_normals = strip_prefix("N");
  if (format != "OFF") tokens.refuse("'OFF', optionally preceded by ST, C and N", magic);
  if (has_texture && has_vertex_colours && requested_marks.colours)
    tokens.refuse("'COFF' or 'CNOFF', colours without a texture", magic);
  // Every vertex and face needs at least six bytes, so the size of the file bounds the counts.
  const auto max_count = static_cast<std::int64_t>(tokens.bytes_left() / 6);
  const std::int64_t vertices =
      tokens.integer(tokens.next(), 0, max_count, "a number of vertices that fits the file size");
  const std::int64_t faces =
      tokens.integer(tokens.next(), 0, max_count, "a number of faces that fits the file size");
  // The number of edges is not needed; many writers state 0.
  tokens.integer(tokens.next(), 0, std::int64_t{1} << 40, "a number of edges");
  source.check_triangles(faces);
  TriangleSoup soup;
  FaceMarkCollector mark_collector(source);
  std::vector<std::optional<FaceColour>> colours;  // of the vertices
  for (std::int64_t i = 0; i < vertices; ++i) {
    soup.points.push_back(tokens.point());
    for (int k = 0; has_normals && k < 3; ++k) tokens.next_in_line();
    if (has_vertex_colours && requested_marks.colours && !has_texture)
      colours.push_back(off_colour(tokens));
    if (has_vertex_colours || has_normals || has_texture) tokens.skip_line();
  }
  for (std::int64_t i = 0; i < faces; ++i) {
    const Token token = tokens.next();
    Polygon face{{}, token.line};
    face.corners.resize(std::size_t(tokens.integer(token, 3, max_corners, "a number of corners")));
    for (int& corner : face.corners)
      corner = static_cast<int>(tokens.integer(tokens.next(), 0, vertices - 1, "a vertex index"));
    soup = append_face(std::move(soup), face, source);
    if (requested_marks.colours) {
      std::optional<FaceColour> colour = off_colour(tokens);
      if (!colour) colour = common_corner_colour(colours, face.corners);
      mark_collector.mark(soup.faces.size(), {{}, colour});
    }
    tokens.skip_line();  // a colour may follow
  }
  soup.marks = mark_collector.marks();
  if (!tokens.at_end())
    tokens.refuse("the end of the file after the faces counted in its header", tokens.next());
  return soup;
}

}  // namespace abbe::cutting
