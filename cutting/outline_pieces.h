#pragma once

#include <vector>

#include "cutting/outline.h"

namespace abbe::cutting {

/// Of the angle from a to b, times their lengths.
inline double sine_between(const Eigen::Vector2d& a, const Eigen::Vector2d& b) {
  return a.x() * b.y() - a.y() * b.x();
}

OutlinePiece line_piece(const Eigen::Vector2d& from, const Eigen::Vector2d& to);

/// Less than half a circle, or half of one.
/// @throws std::invalid_argument for a radius below half the chord
OutlinePiece arc_piece(const Eigen::Vector2d& from, const Eigen::Vector2d& to, double radius);

OutlinePiece arc_piece_about(const Eigen::Vector2d& from, const Eigen::Vector2d& to, double radius,
                             const Eigen::Vector2d& centre);

/// Lines and arcs from the tip through the points to the axis at the top, without sharp corners.
/// @throws std::invalid_argument for numbers below 0 or not finite, for other beginnings and ends,
///         and for arcs too small for their chords
std::vector<OutlinePiece> pieces_through(const std::vector<OutlinePoint>& points);

/// mm; points that are nearer to each other are one.
inline constexpr double same_place = 1e-9;

/// rad, by which a joint may bend inwards: rounding of input.
inline constexpr double least_bend = 1e-7;

/// The sine by which an outline bends inwards at the beginning of a piece; 0 and less: it does not.
double inward_bend(const OutlinePiece& before, const OutlinePiece& piece);

/// Pieces that follow each other, with the sharp corners between them; arcs beyond a right angle as
/// two.
/// @param before  outward normal at the end of what the first follows
/// @throws std::invalid_argument for what bends inwards, with the point and by how much
std::vector<OutlinePiece> with_corners(const std::vector<OutlinePiece>& pieces,
                                       const Eigen::Vector2d& before);

}  // namespace abbe::cutting
