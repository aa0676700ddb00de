#include "sim/calibration/evaluate.h"

#include <algorithm>
#include <cmath>

#include <fmt/format.h>

#include "errors/metrology/position_file.h"
#include "kinematics/bad_input.h"
#include "kinematics/text.h"
#include "kinematics/units.h"
#include "sim/calibration/evaluate_figures.h"
#include "sim/calibration/evaluate_part.h"
#include "sim/calibration/evaluate_tests.h"
#include "sim/readings/part_readings_file.h"
#include "sim/readings/readings_file.h"

namespace abbe::sim {
namespace {

namespace metrology = errors::metrology;
using Eigen::Index;
using Eigen::VectorXd;
using Json = nlohmann::ordered_json;
using metrology::Readings;

Json positioning_json(const std::string& name, const metrology::PositionRuns& runs, bool angle) {
  const metrology::Positioning p = metrology::positioning(runs);
  Json test = test_json(name, "ISO 230-2:2014 positioning");
  test["targets"] = runs.target.size();
  test["runs_up"] = runs.up.cols();
  test["runs_down"] = runs.down.cols();
  Figures f(test, angle);
  const auto one_way = [&](const char* way,
                           const std::optional<metrology::OneWayPositioning>& one) {
    if (!one) return;
    f.put(std::string("A_") + way, one->A);
    f.put(std::string("E_") + way, one->E);
    f.put(std::string("R_") + way, one->R);
  };
  f.put("A", p.A);
  one_way("up", p.up);
  one_way("down", p.down);
  f.put("E", p.E);
  f.put("M", p.M);
  f.put("R", p.R);
  f.put("B", p.B);
  f.put("B_mean", p.B_mean);
  return test;
}

double range(const VectorXd& v) { return v.maxCoeff() - v.minCoeff(); }

/// Slope of the least-squares line through the mean of all runs.
double slope_of(const metrology::PositionRuns& runs) {
  const VectorXd from_middle = runs.target.array() - runs.target.mean();
  return from_middle.dot(mean_of(runs)) / from_middle.squaredNorm();
}

/// Range of the mean of all runs about the line through its ends.
double about_ends(const metrology::PositionRuns& runs) {
  const VectorXd mean = mean_of(runs), &t = runs.target;
  const Index last = t.size() - 1;
  return range(mean - (mean[last] - mean[0]) / (t[last] - t[0]) * t);
}

Json error_motion_json(const AxisTest& test) {
  const char* standard = !test.spindle ? "error motion over the angle"
                         : test.axial  ? "ISO 230-7:2015 axial error motion"
                                       : "ISO 230-7:2015 radial error motion";
  Json json = test_json(test.name, standard);
  json["angles"] = test.runs.target.size();
  std::optional<double> asynchronous;
  for (const Eigen::MatrixXd* runs : {&test.runs.up, &test.runs.down})
    if (runs->cols() > 1)
      asynchronous = std::max(asynchronous.value_or(0.0),
                              (runs->rowwise().maxCoeff() - runs->rowwise().minCoeff()).maxCoeff());
  Figures f(json, false);
  f.put("synchronous",
        hides_in_centring(test) ? std::nullopt : std::optional(range(mean_of(form_of(test)))));
  f.put("asynchronous", asynchronous);
  return json;
}

Json axis_json(const AxisTest& test) {
  if (test.what == AxisTest::What::ErrorMotion) return error_motion_json(test);
  if (test.what == AxisTest::What::Positioning)
    return positioning_json(test.name, test.runs, test.angle);
  const metrology::Positioning p = metrology::positioning(test.runs);
  const bool straight = test.what == AxisTest::What::Straightness;
  Json json = test_json(
      test.name, straight ? "ISO 230-1:2012 straightness" : "ISO 230-1:2012 angular error motion");
  json["targets"] = test.runs.target.size();
  Figures f(json, test.angle);
  if (straight) {
    f.put("straightness_lsq", range(mean_of(form_of(test))));
    f.put("straightness_ends", about_ends(test.runs));
    json["slope_urad"] = slope_of(test.runs) / units::urad;
  } else {
    f.put("range", range(mean_of(test.runs)));
  }
  f.put("R", p.R ? p.R : p.up ? p.up->R : p.down->R);
  f.put("B", p.B);
  return json;
}

// Straightness slopes turn the lines the same way only if the axes turn apart.
Json square_json(const SquareTest& test) {
  Json json = test_json(test.name, "ISO 230-1:2012 squareness");
  json["axes"] = {std::string(1, test.first.axis), std::string(1, test.second.axis)};
  json["squareness_urad"] = -(slope_of(test.first.runs) + slope_of(test.second.runs)) / units::urad;
  json["sign"] = "angle between the positive directions minus 90 degrees";
  return json;
}

Json diagonals_json(const std::vector<DiagonalTest>& tests, const char* which) {
  std::vector<metrology::DiagonalRuns> set;
  for (const DiagonalTest& test : tests) set.push_back(test.runs);
  const metrology::Diagonals d = metrology::diagonals(set);
  Json json = test_json(which, "ISO 230-6:2002 diagonals");
  Figures f(json, false);
  f.put("E_d", d.E_d);
  f.put("B_d", d.B_d);
  Json each = Json::array();
  for (std::size_t i = 0; i < tests.size(); ++i)
    each.push_back(positioning_json(tests[i].name, tests[i].runs.runs, false));
  json["diagonals"] = each;
  return json;
}

Json estimated(const std::optional<metrology::Estimated>& one, double unit) {
  if (!one) return nullptr;
  return {{"value", one->value / unit}, {"standard_uncertainty", one->u / unit}};
}

/// Causes by the keys that they have in `causes_json`, less their units.
std::string cause_key(const std::string& cause, char first, char second) {
  if (cause == "scale") return fmt::format("scale_{}_minus_{}", first, second);
  if (!cause.ends_with("_u") && !cause.ends_with("_v")) return cause;
  return cause.substr(0, cause.size() - 1) + (cause.back() == 'u' ? first : second);
}

/// Causes of a circle; all are open where it has too few places.
metrology::CircularCauses causes_of(const CircleTest& test, bool enough) {
  if (enough) return metrology::circular_causes(test.runs);
  metrology::CircularCauses causes;
  causes.undetermined.assign(metrology::cause_names.begin(), metrology::cause_names.end());
  return causes;
}

/// Which causes a circle leaves open, and why.
std::string why_undetermined(const std::vector<std::string>& open, int places, bool both_senses) {
  std::string names;
  for (const std::string& name : open) names += (names.empty() ? "" : ", ") + name;
  constexpr int least = metrology::circular_cause_count + 1;
  if (places < least)
    return fmt::format(
        "{} cannot be determined: {} causes take readings at {} different places or more, each "
        "sense counted apart, seen {}",
        names, metrology::circular_cause_count, least, places);
  return fmt::format("{} cannot be determined: they read alike at the {} places that were read{}",
                     names, places, both_senses ? "" : ", in one sense alone");
}

Json causes_json(const CircleTest& test) {
  const int places = metrology::place_count(test.runs);
  const bool enough = places > metrology::circular_cause_count;
  const metrology::CircularCauses causes = causes_of(test, enough);
  const char first = test.plane[0], second = test.plane[1];
  std::vector<std::string> open;
  for (const std::string& cause : causes.undetermined)
    open.push_back(cause_key(cause, first, second));
  const bool both_senses =
      test.runs.anticlockwise.angle.size() > 0 && test.runs.clockwise.angle.size() > 0;
  const auto key = [&](const char* cause, const char* unit) {
    return cause_key(cause, first, second) + unit;
  };
  Json json{{"squareness_urad", estimated(causes.squareness, units::urad)},
            {"squareness_sign", fmt::format("{1} turned about {0} x {1}", first, second)},
            {key("scale", "_um_per_m"), estimated(causes.scale, 1e-6)},
            {key("reversal_u", "_um"), estimated(causes.reversal_u, units::um)},
            {key("reversal_v", "_um"), estimated(causes.reversal_v, units::um)},
            {key("centre_u", "_um"), estimated(causes.centre_u, units::um)},
            {key("centre_v", "_um"), estimated(causes.centre_v, units::um)},
            {"unexplained_um", enough ? Json(causes.residual / units::um) : Json(nullptr)},
            {"undetermined", open}};
  if (!open.empty()) json["undetermined_because"] = why_undetermined(open, places, both_senses);
  return json;
}

// A bar that only reads changes of its length knows no radius.
Json circle_json(const CircleTest& test) {
  const metrology::Circular c = metrology::circular(test.runs);
  const auto if_known = [&](double value) {
    return test.zero_known ? std::optional(value) : std::nullopt;
  };
  Json json = test_json(test.name, "ISO 230-4:2005 circular test");
  json["plane"] = test.plane;
  json["readings"] = test.runs.anticlockwise.radius.size() + test.runs.clockwise.radius.size();
  json["places"] = metrology::place_count(test.runs);
  json["nominal_radius_mm"] = test.runs.nominal_radius;
  json["radius_mm"] = test.zero_known ? Json(c.circle.radius) : Json(nullptr);
  Figures f(json, false);
  f.put(std::string("centre_") + test.plane[0], c.circle.centre.x());
  f.put(std::string("centre_") + test.plane[1], c.circle.centre.y());
  const auto put = [&](const std::string& way,
                       const std::optional<metrology::CircularFigures>& one) {
    if (!one) return;
    f.put("G_" + way + "_lsq", one->G_lsq);
    f.put("G_" + way + "_minimum_zone", one->G_minimum_zone);
    f.put("F_max_" + way, if_known(one->F_max));
    f.put("F_min_" + way, if_known(one->F_min));
  };
  put("anticlockwise", c.anticlockwise);
  put("clockwise", c.clockwise);
  put("both", c.both);
  json["F_from"] = c.centre_is == metrology::CircleCentre::LeastSquares
                       ? "least-squares centre"
                       : "centre as set up, since this is no full circle";
  f.put("D", if_known(c.D));
  f.put("H", c.H);
  json["causes"] = causes_json(test);
  return json;
}

Json drift_json(const DriftTest& test) {
  Json json = test_json(test.name, "ISO 230-3:2020 thermal drift");
  const VectorXd& t = test.log.time_s;
  std::vector<metrology::DriftInterval> intervals{{"whole", t[0], t[t.size() - 1]}};
  if (t[t.size() - 1] - t[0] > 3600.0)
    intervals.insert(intervals.begin(), {"first_hour", t[0], t[0] + 3600.0});
  for (const metrology::DriftRange& one : metrology::drift(test.log, intervals)) {
    Json interval{{"hours", (one.interval.to_s - one.interval.from_s) / 3600.0}};
    for (std::size_t c = 0; c < test.log.names.size(); ++c) {
      Json column;
      Figures f(column, test.angle[c]);
      f.put("range", one.range[Index(c)]);
      f.put("change", one.change[Index(c)]);
      interval[test.log.names[c]] = column;
    }
    json[one.interval.name] = interval;
  }
  return json;
}

Json other_json(const OtherTest& test) {
  Json json = test_json(test.name, "range of the readings minus the nominal machine");
  json["readings"] = test.deviation.size();
  Figures f(json, test.angle);
  f.put("range", test.deviation.maxCoeff() - test.deviation.minCoeff());
  f.put("rms", std::sqrt(test.share.dot(test.deviation.cwiseAbs2())));
  return json;
}

bool is_face(const DiagonalTest& test) {
  const auto& signs = test.runs.signs;
  return std::count(signs.begin(), signs.end(), 0) > 0;
}

/// Body and face diagonals apart, and where one comes again, as from another start, a new set.
std::vector<std::vector<DiagonalTest>> sets_of(const std::vector<DiagonalTest>& tests) {
  std::vector<std::vector<DiagonalTest>> sets;
  for (const DiagonalTest& test : tests) {
    const auto fits = [&](const std::vector<DiagonalTest>& set) {
      return is_face(set.front()) == is_face(test) &&
             std::none_of(set.begin(), set.end(), [&](const DiagonalTest& other) {
               return other.runs.signs == test.runs.signs;
             });
    };
    const auto set = std::find_if(sets.begin(), sets.end(), fits);
    if (set == sets.end())
      sets.push_back({test});
    else
      set->push_back(test);
  }
  return sets;
}

Json tests_json(const Tests& tests) {
  Json list = Json::array();
  for (const AxisTest& test : tests.axes) list.push_back(axis_json(test));
  for (const SquareTest& test : tests.squares) list.push_back(square_json(test));
  for (const std::vector<DiagonalTest>& set : sets_of(tests.diagonals))
    list.push_back(diagonals_json(set, is_face(set.front()) ? "face diagonals" : "body diagonals"));
  for (const CircleTest& test : tests.circles) list.push_back(circle_json(test));
  for (const DriftTest& test : tests.drifts) list.push_back(drift_json(test));
  for (const OtherTest& test : tests.others) list.push_back(other_json(test));
  return list;
}

Tests tests_of_sets(const std::vector<metrology::PositionSet>& sets, const std::string& stem) {
  Tests tests;
  for (const metrology::PositionSet& set : sets) {
    AxisTest test;
    test.name = set.name.empty() ? stem : set.name;
    test.angle = test.rotary = set.rotary;
    test.runs = set.runs;
    tests.axes.push_back(std::move(test));
  }
  return tests;
}

struct Read {
  std::string kind;
  Tests tests;
  std::optional<Readings> readings;
  std::optional<PartReadingsFile> part;
};

Read read(const std::filesystem::path& file) {
  const std::string text = read_text(file, std::size_t(256) << 20);
  if (holds_part_readings(text)) {
    PartReadingsFile part = read_part_readings(text, file.string());
    if (part.readings.deviation.size() < 3)
      throw BadInput(file.string(), 0, 0, "at least 3 points of a part", "fewer");
    std::string kind = part.kind;
    return {std::move(kind), {}, std::nullopt, std::move(part)};
  }
  if (!holds_readings(text))
    return {"position file",
            tests_of_sets(metrology::read_positions(text, file.string()), file.stem().string()),
            std::nullopt, std::nullopt};
  Readings readings = read_readings(text, file.string());
  if (readings.value.size() == 0)
    return {readings.plan.kind, {}, std::move(readings), std::nullopt};
  Tests tests = tests_of(readings);
  return {readings.plan.kind, std::move(tests), std::move(readings), std::nullopt};
}

Json temperatures_json(const Readings& readings) {
  Json json = Json::object();
  for (std::size_t k = 0; k < readings.sensors.size(); ++k) {
    const auto column = readings.T_C.col(Index(k));
    json[readings.sensors[k]] = {{"min_C", column.minCoeff()}, {"max_C", column.maxCoeff()}};
  }
  return json;
}

}  // namespace

Evaluation evaluation_of(const std::filesystem::path& file) {
  Read source = read(file);
  Json evaluation{{"file", file.string()}, {"kind", source.kind}};
  try {
    evaluation["tests"] = source.part ? part_tests(*source.part) : tests_json(source.tests);
  } catch (const std::invalid_argument& fault) {
    throw BadInput(file.string(), 0, 0, "readings that a standard can evaluate", fault.what());
  }
  if (source.readings && !source.readings->sensors.empty() && !source.readings->plan.looks.empty())
    evaluation["temperatures"] = temperatures_json(*source.readings);
  return {std::move(evaluation), std::move(source.tests), std::move(source.part)};
}

}  // namespace abbe::sim
