#include "errors/metrology/areal.h"

#include <cmath>
#include <stdexcept>

#include "kinematics/least_squares.h"

namespace abbe::errors::metrology {
namespace {

using Eigen::VectorXd;

void check(const Eigen::MatrixX2d& xy, const VectorXd& z, const VectorXd& weights) {
  if (xy.rows() != z.size() || weights.size() != z.size() || z.size() == 0)
    throw std::invalid_argument("areal: expected one height and one weight for every point");
  if (!xy.allFinite() || !z.allFinite() || !weights.allFinite())
    throw std::invalid_argument("areal: expected finite numbers");
  if (weights.minCoeff() < 0.0 || !(weights.sum() > 0.0))
    throw std::invalid_argument("areal: expected weights of at least 0, not all of them 0");
}

VectorXd from_plane(const Eigen::MatrixX2d& xy, const VectorXd& z, const VectorXd& share) {
  const Eigen::RowVector2d centre = share.transpose() * xy;
  const Eigen::MatrixX2d shifted = xy.rowwise() - centre;
  const double size = shifted.cwiseAbs().maxCoeff();
  if (!(size > 0.0)) throw std::invalid_argument("areal: the points do not fix a plane");
  Eigen::MatrixX3d terms(z.size(), 3);
  terms << VectorXd::Ones(z.size()), shifted / size;
  const VectorXd root = share.cwiseSqrt();
  const Eigen::MatrixX3d weighted = root.asDiagonal() * terms;
  // a strip a thousand million times longer than wide is a line
  const auto fit = least_squares(weighted, VectorXd(root.array() * z.array()), 1e-9);
  if (fit.rank < 3) throw std::invalid_argument("areal: the points do not fix a plane");
  return z - terms * fit.x;
}

}  // namespace

Areal areal(const Eigen::MatrixX2d& xy, const VectorXd& z, const VectorXd& weights,
            const ArealOptions& options) {
  check(xy, z, weights);
  const VectorXd share = weights / weights.sum();
  VectorXd h = z;
  if (options.reference == ArealReference::Plane) h = from_plane(xy, z, share);
  if (options.reference == ArealReference::Mean) h.array() -= share.dot(z);
  Areal result;
  result.Sa = share.dot(h.cwiseAbs());
  result.Sq = std::sqrt(share.dot(h.cwiseAbs2()));
  result.Sp = h.maxCoeff();
  result.Sv = -h.minCoeff();
  result.Sz = result.Sp + result.Sv;
  if (result.Sq > 0.0) {
    const Eigen::ArrayXd unit = h.array() / result.Sq;
    result.Ssk = (share.array() * unit.cube()).sum();
    result.Sku = (share.array() * unit.square().square()).sum();
  }
  return result;
}

}  // namespace abbe::errors::metrology
