#pragma once

#include <functional>
#include <optional>
#include <vector>

#include "cutting/part/mesh.h"
#include "cutting/surface/surface.h"
#include "cutting/surface/tool.h"

/// What the surface engine and its peers are given, so that their answers compare.
namespace abbe::bench {

struct PeerTask {
  cutting::Cutter cutter;
  cutting::CutterMotion motion;
  cutting::Design design;
};

/// (vertices) mm along the normals, NaN where nothing was cut within `searched` of the design.
using Deviations = std::vector<double>;

inline constexpr double searched = 0.3;  ///< mm

/// Where material ends along a normal: the first place from -searched on at which a field, positive
/// in material, is not. NaN if there is none.
/// @param step  mm, in which the field is looked at
double material_end(const std::function<double(const Eigen::Vector3d&)>& field,
                    const cutting::Design& design, Eigen::Index vertex, double step);

/// A narrow band of OpenVDB's level set about the design, filled with the union of the moves: of a
/// ball end exactly (capsules), of other cutters as poses no farther apart than a voxel; then read
/// along the normals. None where OpenVDB is not installed.
/// @param voxel  mm
std::optional<Deviations> openvdb_deviations(const PeerTask& task, double voxel);

}  // namespace abbe::bench
