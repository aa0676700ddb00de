#include "sim/report/result_tables.h"

#include <cmath>
#include <iterator>

#include <fmt/format.h>
#include <nlohmann/json.hpp>

#include "sim/report/little_endian.h"
#include "sim/report/zip_archive.h"

namespace abbe::sim {
namespace {

/// The sign of what is no number is left out.
double plain(double x) { return std::isnan(x) ? std::abs(x) : x; }

/// An array as NumPy's format 1.0 has it: magic, version, length of the head, head, data.
/// @param type   as NumPy names it: "<f8"
/// @param shape  as Python writes a tuple: "(7, 3)"
std::string npy(const std::string& type, const std::string& shape, std::string_view data) {
  std::string head =
      fmt::format("{{'descr': '{}', 'fortran_order': False, 'shape': {}, }}", type, shape);
  constexpr std::size_t before = 10, aligned = 64;
  head.append(aligned - 1 - (before + head.size()) % aligned, ' ');
  head += '\n';
  std::string bytes("\x93NUMPY\x01\x00", 8);
  append(bytes, std::uint16_t(head.size()));
  return bytes.append(head).append(data);
}

template <class T>
std::string_view bytes_of(const T* data, Eigen::Index count) {
  return {reinterpret_cast<const char*>(data), sizeof(T) * std::size_t(count)};
}

template <class Matrix>
std::string npy_rows(const std::string& type, const Matrix& rows) {
  return npy(type, fmt::format("({}, {})", rows.rows(), rows.cols()),
             bytes_of(rows.data(), rows.size()));
}

template <class Values>
std::string npy_column(const std::string& type, const Values& values) {
  return npy(type, fmt::format("({},)", values.size()),
             bytes_of(values.data(), Eigen::Index(values.size())));
}

/// A text without shape: four bytes a character.
std::string npy_text(const std::string& ascii) {
  std::string data;
  for (const char c : ascii) append(data, std::uint32_t(c));
  return npy(fmt::format("<U{}", ascii.size()), "()", data);
}

/// Only ASCII is one unit a character.
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
  const auto put = [&](auto... values) {
    ((fmt::format_to(std::back_inserter(text), "{},", values)), ...);
  };
  const cutting::Design& d = map.design;
  for (Eigen::Index i = 0; i < d.vertices.rows(); ++i) {
    put(d.vertices(i, 0), d.vertices(i, 1), d.vertices(i, 2));
    put(d.normals(i, 0), d.normals(i, 1), d.normals(i, 2));
    put(plain(map.residual_um[i]), plain(map.form_um[i]), plain(map.texture_um[i]));
    put(int(map.status[std::size_t(i)]), plain(map.cut_time_s[i]), map.cut_line[std::size_t(i)],
        d.area[i]);
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
    arrays.push_back({std::string(cutting::name_of_values(map.looked_within)) + ".npy",
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
