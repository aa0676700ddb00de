#pragma once

#include <cstdint>
#include <functional>
#include <span>
#include <vector>

#include <Eigen/Geometry>

#include "cutting/primitive.h"

namespace abbe::cutting {

/// The place of a surface between two or three places of it, at weights that sum to one.
using OnSurface =
    std::function<Contact(std::span<const Contact> corners, std::span<const double> weights)>;

/// Of a mesh whose facets are its surface. The normal is the mean of those at the corners.
Contact on_facet(std::span<const Contact> corners, std::span<const double> weights);

/// Of a mesh whose vertices and normals are those of a smooth surface: half way between the facet
/// and the mean of the tangent planes at its corners, as `contact_above`. On a sphere of radius R
/// with edges L it is L^4 / 20 R^3 off, where the facet is L^2 / 8 R. The facet itself where a
/// normal is more than 30 degrees off it.
Contact on_smooth_facet(std::span<const Contact> corners, std::span<const double> weights);

/// Of a declared surface that stands at T: the nearest place to the facet.
OnSurface on_declared(const Primitive& primitive, const Eigen::Isometry3d& T);

/// The nearest point of a declared surface, its rims included, and the outward normal. Within a
/// hundredth of the profile's size of a kink the normal given says which piece is meant. Exact to
/// 1e-12 mm per metre for points nearer than a tenth of the least radius of curvature.
Contact nearest(const Primitive& primitive, const Eigen::Vector3d& point,
                const Eigen::Vector3d& normal);

/// A design of other vertices, those of the one it is made from first, with their facet error,
/// their groups, faces and seams. The others are of the group of the triangles at them.
/// @param triangles  (m x 3) of the places
/// @param judged     (places)
Design design_on(const Design& from, const std::vector<Contact>& places, Triangles triangles,
                 std::vector<std::uint8_t> judged);

/// A vertex of a design, with its normal and face.
Contact place_of(const Design& design, int vertex);

/// The vertices of a design, with their normals and faces.
std::vector<Contact> places_of(const Design& design);

/// Places as a design without triangles, all judged.
Design design_of_places(const std::vector<Contact>& places);

}  // namespace abbe::cutting
