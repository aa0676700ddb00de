#include "errors/thermal_run.h"

#include <algorithm>
#include <cmath>
#include <stdexcept>
#include <utility>

#include <fmt/format.h>

#include "errors/expect.h"
#include "errors/exponential_differences.h"
#include "errors/thermal_stretch.h"
#include "kinematics/singular_values.h"

namespace abbe::errors {

using Eigen::Index;
using Eigen::MatrixXd;
using Eigen::VectorXd;

namespace {

// ---- what a machine does

void check(const Activity& activity, const ThermalNetwork& network) {
  const std::string who = fmt::format("activity at {} s", activity.time_s);
  for (const double number : {activity.time_s, activity.spindle_speed, activity.cutting_power_W,
                              activity.room_T_C, activity.coolant_T_C})
    expect_finite(number, who, "number");
  if (!activity.axis_speed.allFinite()) refuse(who, "expected finite axis speeds");
  if (activity.axis_speed.size() == 0) return;
  for (const HeatSource& source : network.sources)
    if (const auto* axis = std::get_if<AxisHeat>(&source.law);
        axis && axis->joint >= activity.axis_speed.size())
      refuse(who, fmt::format("expected the speed of joint {}, seen {} speeds", axis->joint,
                              activity.axis_speed.size()));
}

void check(std::span<const Activity> knots, const ThermalNetwork& network) {
  if (knots.empty()) refuse("activity", "expected at least one knot");
  for (std::size_t i = 0; i < knots.size(); ++i) {
    check(knots[i], network);
    if (i > 0 && knots[i].time_s < knots[i - 1].time_s)
      refuse("activity",
             fmt::format("time goes back from {} s to {} s", knots[i - 1].time_s, knots[i].time_s));
  }
}

VectorXd heats_W(const ThermalNetwork& network, const Activity& activity) {
  VectorXd heats = VectorXd::Zero(Index(network.nodes.size()));
  for (const HeatSource& source : network.sources) heats[source.node] += heat_W(source, activity);
  return heats;
}

// ---- modes

/// The network as conductances, parallel ones added up.
struct Mesh {
  MatrixXd between;    ///< (nodes x nodes) symmetric
  VectorXd to_ground;  ///< (nodes) to the surroundings
};

Mesh mesh_of(const ThermalNetwork& network, bool coolant) {
  const Index n = Index(network.nodes.size());
  Mesh mesh{MatrixXd::Zero(n, n), VectorXd::Zero(n)};
  for (const ThermalLink& link : network.links) {
    mesh.between(link.a, link.b) += link.conductance_W_per_K;
    mesh.between(link.b, link.a) += link.conductance_W_per_K;
  }
  for (const SurroundingsLink& link : network.surroundings)
    if (coolant || link.to == Surroundings::Room)
      mesh.to_ground[link.node] += link.conductance_W_per_K;
  return mesh;
}

/// Square roots of heat capacities.
VectorXd roots_of(const ThermalNetwork& network) {
  VectorXd root(Index(network.nodes.size()));
  for (Index i = 0; i < root.size(); ++i)
    root[i] = std::sqrt(network.nodes[std::size_t(i)].capacity_J_per_K);
  return root;
}

/// A column sqrt(G) / sqrt(C) for every conductance.
MatrixXd incidence(const Mesh& mesh, const VectorXd& root) {
  const Index n = root.size();
  MatrixXd B = MatrixXd::Zero(n, n * (n + 1) / 2);
  Index column = 0;
  for (Index i = 0; i < n; ++i) {
    if (mesh.to_ground[i] > 0.0) B(i, column++) = std::sqrt(mesh.to_ground[i]) / root[i];
    for (Index j = 0; j < i; ++j) {
      if (!(mesh.between(i, j) > 0.0)) continue;
      const double g = std::sqrt(mesh.between(i, j));
      B(i, column) = g / root[i];
      B(j, column++) = -g / root[j];
    }
  }
  return B.leftCols(column);
}

/// S = C^-1/2 L C^-1/2 is B B^T of the incidence, so its modes are those of B. Forming L would lose
/// a slow rate in the rounding of a fast one; the singular values of B lie only half as many
/// decades apart.
ThermalModes modes(const ThermalNetwork& network, bool coolant) {
  const VectorXd root = roots_of(network);
  const MatrixXd B = incidence(mesh_of(network, coolant), root);
  if (!B.allFinite())
    refuse("thermal network", "its capacities and conductances are beyond what numbers can hold");
  const SingularValues svd = singular_values(B, Eigen::ComputeThinU);
  const MatrixXd& V = svd.U;
  ThermalModes result{svd.values.cwiseAbs2(), V.transpose() * root.asDiagonal(),
                      root.cwiseInverse().asDiagonal() * V};
  if (!result.rate_per_s.allFinite() || !result.to_modes.allFinite() ||
      !result.to_nodes.allFinite())
    refuse("thermal network", "its capacities and conductances are beyond what numbers can hold");
  return result;
}

bool has_coolant(const ThermalNetwork& network) {
  return std::any_of(network.surroundings.begin(), network.surroundings.end(),
                     [](const SurroundingsLink& link) { return link.to == Surroundings::Coolant; });
}

// ---- from knot to knot

/// How far the modes go in a time h, from z. As a difference, so that its rounding is that of the
/// change and not of the whole.
VectorXd change(const ThermalStretch& stretch, const VectorXd& z, double h) {
  VectorXd dz(z.size());
  for (Index k = 0; k < z.size(); ++k) {
    const double rate = stretch.modes->rate_per_s[k];
    const double x = rate * h;
    dz[k] = h * (phi1(x) * (stretch.flow[k] - rate * z[k]) + h * phi2(x) * stretch.flow_rise[k]);
  }
  return dz;
}

/// Integral of the modes over a whole stretch.
VectorXd integral(const ThermalStretch& stretch, const VectorXd& z) {
  const double h = stretch.length;
  VectorXd sum(z.size());
  for (Index k = 0; k < z.size(); ++k) {
    const double x = stretch.modes->rate_per_s[k] * h;
    sum[k] =
        h * (phi1(x) * z[k] + h * (phi2(x) * stretch.flow[k] + h * phi3(x) * stretch.flow_rise[k]));
  }
  return sum;
}

/// A sum that keeps what rounding takes off: near a steady state a knot's change is far below an
/// ulp of the whole, and it must not stop there.
struct KeptSum {
  VectorXd value, lost;

  explicit KeptSum(VectorXd start) : value(std::move(start)), lost(VectorXd::Zero(value.size())) {}
  void add(const VectorXd& change) {
    const VectorXd wanted = change - lost;
    const VectorXd next = value + wanted;
    lost = (next - value) - wanted;
    value = next;
  }
};

/// Temperatures over the ground for heat into the nodes, by turning the star about one node after
/// another into a mesh. Nothing is subtracted, so no conductance is lost beside a larger one.
VectorXd over_ground(Mesh mesh, VectorXd heat) {
  const Index n = heat.size();
  VectorXd total(n);
  for (Index k = n - 1; k >= 0; --k) {
    total[k] = mesh.to_ground[k] + mesh.between.row(k).head(k).sum();
    const VectorXd share = mesh.between.col(k).head(k) / total[k];
    mesh.between.topLeftCorner(k, k) += share * mesh.between.row(k).head(k);
    mesh.between.diagonal().head(k).setZero();
    mesh.to_ground.head(k) += share * mesh.to_ground[k];
    heat.head(k) += share * heat[k];
  }
  VectorXd T(n);
  for (Index k = 0; k < n; ++k)
    T[k] = (heat[k] + mesh.between.row(k).head(k).dot(T.head(k))) / total[k];
  return T;
}

}  // namespace

ThermalRun simulate(const ThermalNetwork& network, std::span<const Activity> knots) {
  validate(network);
  check(knots, network);
  const Index n = Index(knots.size());
  const Index nodes = Index(network.nodes.size());
  ThermalRun run{network,
                 {knots.begin(), knots.end()},
                 MatrixXd(n, nodes),
                 MatrixXd(n, nodes),
                 modes(network, false),
                 {}};
  run.wet = has_coolant(network) ? modes(network, true) : run.dry;
  for (Index i = 0; i < n; ++i) run.heat_W.row(i) = heats_W(network, knots[std::size_t(i)]);
  if (!run.heat_W.allFinite()) refuse("activity", "expected finite heat of every source");
  run.T_C.row(0) = network.start_T_C;
  const ThermalModes* current = nullptr;
  KeptSum z{VectorXd()};
  for (std::size_t i = 0; i + 1 < knots.size(); ++i) {
    run.T_C.row(Index(i) + 1) = run.T_C.row(Index(i));
    const ThermalStretch stretch = stretch_after(run, i);
    if (stretch.length == 0.0) continue;
    if (stretch.modes != current) z = KeptSum(modal(run, *stretch.modes, i));
    current = stretch.modes;
    z.add(change(stretch, z.value, stretch.length));
    run.T_C.row(Index(i) + 1) = (current->to_nodes * z.value).transpose().array() + base_T_C(run);
  }
  return run;
}

VectorXd temperatures(const ThermalRun& run, double time_s) {
  if (!(time_s > run.knots.front().time_s)) return run.T_C.row(0);
  const std::size_t knot = knot_before(run, time_s);
  const double h = time_s - run.knots[knot].time_s;
  if (h == 0.0) return run.T_C.row(Index(knot));
  const ThermalStretch stretch = stretch_after(run, knot);
  const VectorXd z = modal(run, *stretch.modes, knot);
  return run.T_C.row(Index(knot)).transpose() + stretch.modes->to_nodes * change(stretch, z, h);
}

VectorXd steady_state(const ThermalNetwork& network, const Activity& activity) {
  validate(network);
  check(activity, network);
  const VectorXd heat =
      heats_W(network, activity) + inflow(network, activity, activity.coolant, activity.room_T_C);
  return over_ground(mesh_of(network, activity.coolant), heat).array() + activity.room_T_C;
}

HeatBalance heat_balance(const ThermalRun& run, std::size_t from_knot, std::size_t to_knot) {
  if (to_knot >= run.knots.size() || from_knot > to_knot)
    throw std::out_of_range(fmt::format("heat balance: expected knots 0 .. {} in order, seen {} {}",
                                        run.knots.size() - 1, from_knot, to_knot));
  HeatBalance balance;
  const double base = base_T_C(run);
  for (std::size_t i = from_knot; i < to_knot; ++i) {
    const Activity &from = run.knots[i], &to = run.knots[i + 1];
    const ThermalStretch stretch = stretch_after(run, i);
    const double h = stretch.length;
    balance.generated_J +=
        0.5 * h * (run.heat_W.row(Index(i)).sum() + run.heat_W.row(Index(i) + 1).sum());
    const VectorXd over_base =
        stretch.modes->to_nodes * integral(stretch, modal(run, *stretch.modes, i));
    for (const SurroundingsLink& link : run.network.surroundings) {
      const bool room = link.to == Surroundings::Room;
      if (!room && !from.coolant) continue;
      const double outside =
          room ? 0.5 * (from.room_T_C + to.room_T_C) : 0.5 * (from.coolant_T_C + to.coolant_T_C);
      balance.to_surroundings_J +=
          link.conductance_W_per_K * (over_base[link.node] - h * (outside - base));
    }
  }
  for (Index k = 0; k < Index(run.network.nodes.size()); ++k)
    balance.stored_J += run.network.nodes[std::size_t(k)].capacity_J_per_K *
                        (run.T_C(Index(to_knot), k) - run.T_C(Index(from_knot), k));
  return balance;
}

}  // namespace abbe::errors
