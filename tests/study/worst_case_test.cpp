#include "sim/study/worst_case.h"

#include <array>
#include <chrono>
#include <cmath>
#include <iostream>
#include <random>

#include <gtest/gtest.h>
#include <tbb/global_control.h>

#include "kinematics/units.h"
#include "tests/study/flat_machine.h"

namespace abbe::sim::study {
namespace {

using Eigen::VectorXd;
using Kind = Distribution::Kind;

/// All corners of a box. (p x 2^p)
Eigen::MatrixXd corners(const Box& box) {
  const Eigen::Index p = box.low.size();
  return Eigen::MatrixXd::NullaryExpr(p, Eigen::Index(1) << p, [&](Eigen::Index i, Eigen::Index k) {
    return (k >> i) & 1 ? box.high[i] : box.low[i];
  });
}

Eigen::MatrixXd interior(const Box& box, Eigen::Index count, unsigned seed) {
  std::mt19937 random(seed);
  std::uniform_real_distribution<double> unit(0.0, 1.0);
  return Eigen::MatrixXd::NullaryExpr(box.low.size(), count, [&](Eigen::Index i, Eigen::Index) {
    return box.low[i] + unit(random) * (box.high[i] - box.low[i]);
  });
}

TEST(WorstCase, BoxTakesTheEndsOfDistributionsAndElseTheCoverage) {
  const Study study = study_of({{Kind::Normal, 1.0, 2.0},
                                {Kind::Normal, 1.0, 2.0, -0.5, 8.0},
                                {Kind::Uniform, 3.0, 0.5},
                                {Kind::Triangular, 0.0, 1.0, -2.0, 0.25},
                                {Kind::LogNormal, 2.0, 0.1}});
  const Box box = input_box(study, 3.0);
  const std::array low = {-5.0, -0.5, 2.5, -1.0, 2.0 * std::exp(-0.3)};
  const std::array high = {7.0, 8.0, 3.5, 0.25, 2.0 * std::exp(0.3)};
  for (Eigen::Index i = 0; i < 5; ++i) {
    EXPECT_NEAR(box.low[i], low[std::size_t(i)], 1e-12) << i;
    EXPECT_NEAR(box.high[i], high[std::size_t(i)], 1e-12) << i;
  }
}

TEST(WorstCase, TiltOfAPlaneIsWorstAtItsEndAndTheBoundIsExact) {
  Eigen::MatrixXd slope(2, 201);  // a tilt, and a shift of all vertices, which PV does not see
  slope.row(0) = VectorXd::LinSpaced(201, -1e-3, 1e-3).transpose();
  slope.row(1).setConstant(5e-3);
  const FlatMachine machine = flat(study_of(normals(2)), slope);
  const Corner corner = worst_corner(input_box(machine.study, 3.0), machine.influence, Response::Pv,
                                     function_of(machine.influence, Response::Pv));
  EXPECT_NEAR(corner.response, 6e-3, 1e-15);
  EXPECT_NEAR(corner.bound, 6e-3, 1e-15);
  EXPECT_EQ(std::abs(corner.inputs[0]), 3.0);
}

/// How what is found and what bounds it compare with all corners.
struct Quality {
  double found = 1.0;  ///< least share of the true worst corner
  double bound = 1.0;  ///< largest bound over it
};

void judge(const FlatMachine& machine, Response response, Quality& quality) {
  const Box box = input_box(machine.study, 3.0);
  const ResponseFunction function = function_of(machine.influence, response);
  const Corner corner = worst_corner(box, machine.influence, response, function);
  const double worst = function.values(corners(box)).maxCoeff();
  const double inside = function.values(interior(box, 2000, 5)).maxCoeff();
  EXPECT_NEAR(corner.response, function.values(corner.inputs)[0], 1e-15);
  EXPECT_LE(corner.response, worst + 1e-15);
  EXPECT_LE(worst, corner.bound + 1e-15);
  EXPECT_LE(inside, corner.bound + 1e-15);
  for (Eigen::Index i = 0; i < box.low.size(); ++i)
    EXPECT_TRUE(corner.inputs[i] == box.low[i] || corner.inputs[i] == box.high[i]);
  quality.found = std::min(quality.found, corner.response / worst);
  quality.bound = std::max(quality.bound, corner.bound / worst);
}

Quality judged(Response response, bool competing_passes, int min_inputs, int max_inputs) {
  Quality quality;
  for (unsigned seed = 1; seed <= 12; ++seed) {
    SCOPED_TRACE(testing::Message() << name_of(response) << " seed " << seed);
    Study study = study_of(normals(min_inputs + int(seed) % (max_inputs - min_inputs + 1)));
    study.inputs[1].distribution = {Kind::Uniform, 0.5, 1.0, -0.1, 1.2};
    FlatMachine machine = random_machine(std::move(study), 150, seed);
    if (!competing_passes) {
      Eigen::MatrixXd first(machine.influence.slope.rows(), 150);
      for (Eigen::Index v = 0; v < 150; ++v)
        first.col(v) = machine.influence.slope.col(
            std::min(machine.influence.first[std::size_t(v)], machine.influence.slope.cols() - 1));
      machine = flat(machine.study, first);
    }
    judge(machine, response, quality);
  }
  std::cout << name_of(response) << (competing_passes ? ", rivals, " : ", linear, ") << min_inputs
            << " .. " << max_inputs << " inputs: found at least " << 100.0 * quality.found
            << " % of the worst of all corners, bound at most " << 100.0 * quality.bound << " %\n";
  return quality;
}

constexpr std::array bounded = {Response::Pv, Response::Rms, Response::Mean, Response::Std,
                                Response::MaxAbs};

TEST(WorstCase, PvOfOneRivalIsTheWorstOfAllCornersAndItsBoundIsThat) {
  for (const int inputs : {2, 13}) {
    const Quality quality = judged(Response::Pv, false, inputs, inputs + (inputs == 2 ? 10 : 1));
    EXPECT_NEAR(quality.found, 1.0, 1e-12);
    EXPECT_NEAR(quality.bound, 1.0, 1e-12);
  }
}

TEST(WorstCase, OfAFewInputsTheCornerIsTheWorstAndTheBoundHolds) {
  for (const Response response : bounded) {
    const Quality quality = judged(response, true, 2, 12);
    EXPECT_NEAR(quality.found, 1.0, 1e-12) << name_of(response);
    EXPECT_LT(quality.bound, response == Response::Mean ? 3.0 : 1.5) << name_of(response);
  }
}

TEST(WorstCase, OfMoreInputsTheSearchComesNearTheWorstCorner) {
  for (const Response response : bounded) {
    const Quality quality = judged(response, true, 13, 14);
    EXPECT_GE(quality.found, 0.999) << name_of(response);
    EXPECT_LT(quality.bound, response == Response::Mean ? 4.0 : 1.6) << name_of(response);
  }
}

TEST(WorstCase, GradientsAreDifferencesOfTheResponse) {
  for (const Response response :
       {Response::Pv, Response::Rms, Response::Mean, Response::Std, Response::MaxAbs}) {
    const FlatMachine machine = random_machine(study_of(normals(5)), 120, 9);
    const ResponseFunction function = function_of(machine.influence, response);
    const Eigen::MatrixXd x = interior(input_box(machine.study, 2.0), 40, 11);
    const Eigen::MatrixXd g = function.gradients(x);
    const double h = 1e-6;
    double worst = 0.0;
    for (Eigen::Index i = 0; i < 5; ++i) {
      Eigen::MatrixXd up = x, down = x;
      up.row(i).array() += h;
      down.row(i).array() -= h;
      const VectorXd slope = (function.values(up) - function.values(down)) / (2.0 * h);
      worst = std::max(worst, (slope - g.row(i).transpose()).cwiseAbs().maxCoeff());
    }
    std::cout << name_of(response) << ": gradient within " << worst << " mm per unit\n";
    EXPECT_LT(worst, 1e-8) << name_of(response);  // of slopes of 1e-3
  }
}

TEST(WorstCase, CountedResponsesHaveNoGradient) {
  const FlatMachine machine = flat(study_of(normals(1)), Eigen::MatrixXd::Ones(1, 3));
  for (const Response filtered : {Response::FormPv, Response::TextureSq}) {
    EXPECT_THROW(gradients(machine.influence, filtered, VectorXd::Zero(1)), std::invalid_argument);
    EXPECT_EQ(response_bound(machine.influence, input_box(machine.study, 3.0), filtered, 1.0),
              infinity)
        << "nothing is promised of a filtered map";
  }
  EXPECT_THROW(gradients(machine.influence, Response::P95Abs, VectorXd::Zero(1)),
               std::invalid_argument);
}

TEST(WorstCase, WhereNothingIsCutNothingBreaks) {
  FlatMachine machine = flat(study_of(normals(2)), Eigen::MatrixXd::Zero(2, 3));
  machine.influence.first = {0, 0, 0, 0};
  machine.influence.slope.resize(2, 0);
  machine.influence.shift.resize(2, 0);
  machine.influence.distance.resize(0);
  machine.influence.half_curvature.resize(0);
  const ResponseFunction nothing = {
      [](const Eigen::MatrixXd& x) { return VectorXd::Constant(x.cols(), NAN); },
      [&](const Eigen::MatrixXd& x) { return gradients(machine.influence, Response::Pv, x); }};
  const Corner corner =
      worst_corner(input_box(machine.study, 3.0), machine.influence, Response::Pv, nothing);
  EXPECT_TRUE(std::isnan(corner.response));
}

TEST(WorstCase, AHundredInputsAndThousandsOfVerticesAreBoundedInSecondsWithTheSameBits) {
  const FlatMachine machine = random_machine(study_of(normals(100)), 3000, 21);
  const ResponseFunction function = function_of(machine.influence, Response::Pv);
  const auto with = [&](std::size_t threads) {
    const tbb::global_control control(tbb::global_control::max_allowed_parallelism, threads);
    return worst_corner(input_box(machine.study, 3.0), machine.influence, Response::Pv, function);
  };
  const auto begin = std::chrono::steady_clock::now();
  const Corner corner = with(2);
  const std::chrono::duration<double> took = std::chrono::steady_clock::now() - begin;
  const double random =
      function.values(interior(input_box(machine.study, 3.0), 2000, 3)).maxCoeff();
  std::cout << "100 inputs, 3000 vertices: " << corner.response << " mm found, bound "
            << corner.bound << ", worst of 2000 random machines " << random << ", " << took.count()
            << " s\n";
  EXPECT_GT(corner.response, random);
  EXPECT_LE(corner.response, corner.bound);
  const Corner again = with(1);
  EXPECT_EQ(corner.inputs, again.inputs);
  EXPECT_EQ(corner.response, again.response);
  EXPECT_EQ(corner.bound, again.bound);
}

}  // namespace
}  // namespace abbe::sim::study
