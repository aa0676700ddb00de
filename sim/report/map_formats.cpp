#include "sim/report/map_formats.h"

#include <algorithm>
#include <bit>
#include <cmath>
#include <cstdint>
#include <cstring>
#include <iterator>
#include <limits>
#include <stdexcept>
#include <string>
#include <type_traits>

#include <fmt/format.h>
#include <zlib.h>
#include <Eigen/Geometry>
#include <nlohmann/json.hpp>

#include "kinematics/bad_input.h"
#include "kinematics/units.h"
#include "sim/files/program_file.h"

namespace abbe::sim {

/// Appends a number in little-endian order, as binary formats require.
template <class T>
void append(std::string& bytes, T value) {
  static_assert(std::endian::native == std::endian::little && std::is_arithmetic_v<T>);
  char raw[sizeof value];
  std::memcpy(raw, &value, sizeof value);
  bytes.append(raw, sizeof value);
}

ResultMap result_map(const Job& job, const Verdict& verdict) {
  const cutting::Surface& surface = verdict.alignment.surface;
  ResultMap map;
  map.facts = {job.scene.title, verdict.cut.name, job.scene.seed, job.scene.part.form_cutoff, {}};
  map.facts.tolerance = job.scene.part.tolerance;
  map.design = cutting::transformed(job.design_w, job.scene.part.T_wm.inverse());
  map.residual_um = surface.residual / units::um;
  map.interior_sample = surface.interior_sample;
  map.within_um = surface.within / units::um;
  map.form_um = verdict.form_map / units::um;
  map.texture_um = map.residual_um - map.form_um;
  if (std::ranges::any_of(job.scene.part.regions,
                          [](const PartRegion& region) { return region.tolerance.has_value(); }))
    map.tolerance_um = verdict.tolerance / units::um;
  for (const cutting::VertexStatus status : surface.status)
    map.status.push_back(std::uint8_t(status));
  map.cut_time_s = surface.cut_time_s;
  map.cut_line = surface.cut_line;
  return map;
}

nlohmann::ordered_json to_json(const MapFacts& facts) {
  using nlohmann::ordered_json;
  return {{"unit", "mm"},
          {"residual_unit", "um"},
          {"sign", "+ material left, - gouged; along the outward normal of the design"},
          {"status", "0 cut, 1 uncut, 2 not judged, 3 gouged deeper than the band"},
          {"frame", "part"},
          {"scene", facts.scene},
          {"case", facts.case_name},
          {"seed", facts.seed},
          {"version", version()},
          {"form_cutoff_mm", facts.form_cutoff},
          {"tolerance_um", facts.tolerance ? ordered_json{facts.tolerance->lower / units::um,
                                                          facts.tolerance->upper / units::um}
                                           : ordered_json()}};
}

std::vector<std::pair<std::string, std::string>> fact_texts(const MapFacts& facts) {
  std::vector<std::pair<std::string, std::string>> texts;
  const nlohmann::ordered_json json = to_json(facts);  // must outlive items(), which is a view
  for (const auto& [name, value] : json.items())
    texts.emplace_back(name, escaped(value.is_string() ? value.get<std::string>()
                                     : value.is_null() ? "none"
                                                       : value.dump()));
  return texts;
}

namespace {

/// Returns a size or an offset in 32 bits, as archives without the zip64 extension store it.
std::uint32_t checked_uint32(std::size_t size) {
  // The largest value is reserved: it means that a 64-bit field follows.
  if (size >= std::numeric_limits<std::uint32_t>::max())
    throw std::length_error("a zip archive without 64-bit sizes is limited to 4 GiB");
  return std::uint32_t(size);
}

/// Returns the fields that the local header and the directory header of an entry have in common.
std::string common_header(const ZipEntry& entry, const std::string& packed) {
  // Deflate needs version 2.0. The date is fixed to 1980-01-01 (0x21), so that equal entries give
  // equal bytes.
  constexpr std::uint16_t version = 20, flags = 0, deflate = 8, time = 0, date = 0x21;
  std::string header;
  for (const std::uint16_t field : {version, flags, deflate, time, date}) append(header, field);
  append(header, std::uint32_t(::crc32(0, reinterpret_cast<const Bytef*>(entry.bytes.data()),
                                       uInt(entry.bytes.size()))));
  append(header, checked_uint32(packed.size()));
  append(header, checked_uint32(entry.bytes.size()));
  append(header, std::uint16_t(entry.name.size()));
  append(header, std::uint16_t(0));  // no extra fields
  return header;
}

}  // namespace

std::string deflate_bytes(const std::string& bytes, DeflateHeader header) {
  z_stream stream{};
  // These are zlib's defaults: a window of 32 kB, memory level 8.
  constexpr int window = 15, memory = 8;
  const int bits = header == DeflateHeader::Zlib ? window : -window;
  if (::deflateInit2(&stream, Z_DEFAULT_COMPRESSION, Z_DEFLATED, bits, memory,
                     Z_DEFAULT_STRATEGY) != Z_OK)
    throw std::runtime_error("zlib cannot be initialised");
  std::string packed(::deflateBound(&stream, checked_uint32(bytes.size())), '\0');
  // zlib does not change the input, but its interface is not const.
  stream.next_in = reinterpret_cast<Bytef*>(const_cast<char*>(bytes.data()));
  stream.avail_in = uInt(bytes.size());
  stream.next_out = reinterpret_cast<Bytef*>(packed.data());
  stream.avail_out = uInt(checked_uint32(packed.size()));
  const int result = ::deflate(&stream, Z_FINISH);
  packed.resize(stream.total_out);
  ::deflateEnd(&stream);
  if (result != Z_STREAM_END) throw std::runtime_error("zlib failed to compress");
  return packed;
}

std::string zip_archive(const std::vector<ZipEntry>& entries) {
  std::string archive, directory;
  for (const ZipEntry& entry : entries) {
    const std::string packed = deflate_bytes(entry.bytes, DeflateHeader::None),
                      header = common_header(entry, packed);
    const std::uint32_t offset = checked_uint32(archive.size());
    archive.append("PK\x03\x04").append(header).append(entry.name).append(packed);
    directory.append("PK\x01\x02");
    append(directory, std::uint16_t(20));  // made by version 2.0, for no particular system
    directory += header;
    // Comment length, disk number, internal attributes.
    for (int field = 0; field < 3; ++field) append(directory, std::uint16_t(0));
    append(directory, std::uint32_t(0));  // external attributes
    append(directory, offset);
    directory += entry.name;
  }
  const std::uint32_t directory_offset = checked_uint32(archive.size());
  archive.append(directory).append("PK\x05\x06");
  for (int disk = 0; disk < 2; ++disk) append(archive, std::uint16_t(0));  // numbers of disks
  // Number of entries on this disk, and in total.
  for (int count = 0; count < 2; ++count) append(archive, std::uint16_t(entries.size()));
  append(archive, checked_uint32(directory.size()));
  append(archive, directory_offset);
  append(archive, std::uint16_t(0));  // no comment
  return archive;
}

namespace {

/// Returns the header of a PLY file with the facts as comments.
std::string ply_file_header(const ResultMap& map) {
  // MeshLab recognises `quality` only if it is a float.
  std::string header =
      "ply\nformat binary_little_endian 1.0\n"
      "comment residual map of abbe; quality is the residual in um, nan where not cut\n";
  for (const auto& [name, text] : fact_texts(map.facts))
    header += fmt::format("comment {}: {}\n", name, text);
  header += fmt::format("element vertex {}\n", map.design.vertices.rows());
  for (const char* name : {"x", "y", "z"}) header += fmt::format("property double {}\n", name);
  for (const char* name : {"nx", "ny", "nz", "quality"})
    header += fmt::format("property float {}\n", name);
  return header +
         fmt::format(
             "property uchar status\nelement face {}\nproperty list uchar int vertex_indices\n"
             "end_header\n",
             map.design.triangles.rows());
}

/// Returns the vertices of the machined surface. An uncut vertex stays on the design, because its
/// height is unknown.
cutting::Points machined_vertices(const ResultMap& map) {
  cutting::Points points = map.design.vertices;
  for (Eigen::Index i = 0; i < points.rows(); ++i)
    if (map.status[std::size_t(i)] == std::uint8_t(cutting::VertexStatus::Cut))
      points.row(i) += map.residual_um[i] * units::um * map.design.normals.row(i);
  return points;
}

/// Returns the header of a binary STL file: 80 bytes of ASCII. It must not begin with "solid", by
/// which text files are recognised.
std::string stl_file_header(const std::string& description) {
  std::string header = fmt::format("abbe {}, {}", version(), description);
  for (char& c : header)
    if (c < ' ' || c > '~') c = '?';
  header.resize(80, ' ');
  return header;
}

}  // namespace

std::string to_ply(const ResultMap& map) {
  std::string bytes = ply_file_header(map);
  bytes.reserve(bytes.size() + 41 * std::size_t(map.design.vertices.rows()) +
                13 * std::size_t(map.design.triangles.rows()));
  for (Eigen::Index i = 0; i < map.design.vertices.rows(); ++i) {
    for (const double x : map.design.vertices.row(i)) append(bytes, x);
    for (const double x : map.design.normals.row(i)) append(bytes, float(x));
    append(bytes, float(map.residual_um[i]));
    append(bytes, map.status[std::size_t(i)]);
  }
  for (const auto& triangle : map.design.triangles.rowwise()) {
    append(bytes, std::uint8_t(3));
    for (const int corner : triangle) append(bytes, std::int32_t(corner));
  }
  return bytes;
}

std::string to_stl(const ResultMap& map) {
  return to_stl(machined_vertices(map), map.design.triangles,
                fmt::format("machined surface, mm, seed {}, {}: {}", map.facts.seed,
                            map.facts.case_name, map.facts.scene));
}

std::string to_stl(const cutting::Points& vertices, const cutting::Triangles& triangles,
                   const std::string& description) {
  std::string bytes = stl_file_header(description);
  bytes.reserve(84 + 50 * std::size_t(triangles.rows()));
  append(bytes, std::uint32_t(triangles.rows()));
  for (const auto& t : triangles.rowwise()) {
    const Eigen::RowVector3d a = vertices.row(t[0]), b = vertices.row(t[1]), c = vertices.row(t[2]);
    const Eigen::RowVector3d normal = (b - a).cross(c - a).normalized();
    for (const Eigen::RowVector3d& p : {normal, a, b, c})
      for (const double x : p) append(bytes, float(x));
    append(bytes, std::uint16_t(0));
  }
  return bytes;
}

namespace {

/// Removes the sign of NaN, so that it prints the same on every computer.
double unsigned_nan(double x) { return std::isnan(x) ? std::abs(x) : x; }

/// Returns an array in NumPy's format 1.0: magic, version, length of the header, header, data.
/// @param type   as NumPy names it, such as "<f8"
/// @param shape  as a Python tuple, such as "(7, 3)"
std::string npy(const std::string& type, const std::string& shape, std::string_view data) {
  std::string header =
      fmt::format("{{'descr': '{}', 'fortran_order': False, 'shape': {}, }}", type, shape);
  // NumPy aligns data to 64 bytes; magic, version and length take the first 10.
  constexpr std::size_t prefix = 10, alignment = 64;
  header.append(alignment - 1 - (prefix + header.size()) % alignment, ' ');
  header += '\n';
  std::string bytes("\x93NUMPY\x01\x00", 8);
  append(bytes, std::uint16_t(header.size()));
  return bytes.append(header).append(data);
}

template <class T>
std::string_view raw_bytes(const T* data, Eigen::Index count) {
  return {reinterpret_cast<const char*>(data), sizeof(T) * std::size_t(count)};
}

template <class Matrix>
std::string npy_rows(const std::string& type, const Matrix& rows) {
  return npy(type, fmt::format("({}, {})", rows.rows(), rows.cols()),
             raw_bytes(rows.data(), rows.size()));
}

template <class Values>
std::string npy_column(const std::string& type, const Values& values) {
  return npy(type, fmt::format("({},)", values.size()),
             raw_bytes(values.data(), Eigen::Index(values.size())));
}

/// Returns a scalar text with four bytes per character.
std::string npy_text(const std::string& ascii) {
  std::string data;
  for (const char c : ascii) append(data, std::uint32_t(c));
  return npy(fmt::format("<U{}", ascii.size()), "()", data);
}

/// Returns the facts as JSON text, in ASCII as `npy_text` requires.
std::string npy_facts(const MapFacts& facts) {
  return npy_text(
      to_json(facts).dump(-1, ' ', true, nlohmann::ordered_json::error_handler_t::replace));
}

}  // namespace

std::string to_csv(const ResultMap& map) {
  std::string text;
  for (const auto& [name, value] : fact_texts(map.facts))
    text += fmt::format("# {}: {}\n", name, value);
  text +=
      "x_mm,y_mm,z_mm,nx,ny,nz,residual_um,form_um,texture_um,status,cut_time_s,cut_line,area_"
      "mm2\n";
  const auto append_values = [&](auto... values) {
    ((fmt::format_to(std::back_inserter(text), "{},", values)), ...);
  };
  const cutting::Design& design = map.design;
  for (Eigen::Index i = 0; i < design.vertices.rows(); ++i) {
    append_values(design.vertices(i, 0), design.vertices(i, 1), design.vertices(i, 2));
    append_values(design.normals(i, 0), design.normals(i, 1), design.normals(i, 2));
    append_values(unsigned_nan(map.residual_um[i]), unsigned_nan(map.form_um[i]),
                  unsigned_nan(map.texture_um[i]));
    append_values(int(map.status[std::size_t(i)]), unsigned_nan(map.cut_time_s[i]),
                  map.cut_line[std::size_t(i)], design.area[i]);
    text.back() = '\n';
  }
  return text;
}

std::string to_npz(const ResultMap& map) {
  std::vector<ZipEntry> arrays = {{"vertices.npy", npy_rows("<f8", map.design.vertices)},
                                  {"triangles.npy", npy_rows("<i4", map.design.triangles)},
                                  {"normals.npy", npy_rows("<f8", map.design.normals)},
                                  {"area_mm2.npy", npy_column("<f8", map.design.area)},
                                  {"residual_um.npy", npy_column("<f8", map.residual_um)},
                                  {"form_um.npy", npy_column("<f8", map.form_um)},
                                  {"texture_um.npy", npy_column("<f8", map.texture_um)},
                                  {"status.npy", npy_column("|u1", map.status)},
                                  {"cut_time_s.npy", npy_column("<f8", map.cut_time_s)},
                                  {"cut_line.npy", npy_column("<i4", map.cut_line)},
                                  {"meta.npy", npy_facts(map.facts)}};
  if (map.within_um.size() > 0)
    arrays.push_back({std::string(cutting::sample_values_name(map.interior_sample)) + ".npy",
                      npy_column("<f8", map.within_um)});
  if (map.tolerance_um.rows() > 0) {
    arrays.push_back({"lower_um.npy", npy_column("<f8", Eigen::VectorXd(map.tolerance_um.col(0)))});
    arrays.push_back({"upper_um.npy", npy_column("<f8", Eigen::VectorXd(map.tolerance_um.col(1)))});
  }
  return zip_archive(arrays);
}

std::string to_npz(const ToolTrack& track, const std::string& axes, const MapFacts& facts) {
  return zip_archive({{"time_s.npy", npy_column("<f8", track.time_s)},
                      {"line.npy", npy_column("<i4", track.line)},
                      {"q.npy", npy_rows("<f8", track.q)},
                      {"nominal_tip.npy", npy_rows("<f8", track.nominal_tip)},
                      {"nominal_direction.npy", npy_rows("<f8", track.nominal_direction)},
                      {"actual_tip.npy", npy_rows("<f8", track.actual_tip)},
                      {"actual_direction.npy", npy_rows("<f8", track.actual_direction)},
                      {"axes.npy", npy_text(axes)},
                      {"meta.npy", npy_facts(facts)}});
}

}  // namespace abbe::sim
