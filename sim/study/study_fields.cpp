#include "sim/study/study_fields.h"

#include <algorithm>
#include <array>
#include <limits>

#include <fmt/format.h>

// Keys of a study: its responses, distributions and analyses.

namespace abbe::sim::study {

namespace {

constexpr double max_spread = 1e12;  // in any unit; sums of larger spreads lose digits
constexpr Range confidence_range{0.5, 0.999};

/// Returns the names of all responses for messages: "pv, rms ... or texture_sz".
std::string response_names() {
  std::string text;
  for (const Response response : all_responses) {
    if (response != all_responses.front()) text += response == all_responses.back() ? " or " : ", ";
    text += name_of(response);
  }
  return text;
}

std::string distribution_text(const Distribution& distribution) {
  return fmt::format("centre {}, spread {}, from {} to {}", distribution.centre,
                     distribution.spread, distribution.low, distribution.high);
}

/// Reads `responses`, ignoring repetitions; PV and RMS if there are none.
void read_responses(TableReader& reader, Study& study) {
  for (const std::string& name : reader.texts("responses")) {
    const auto match = std::find_if(all_responses.begin(), all_responses.end(),
                                    [&](Response response) { return name == name_of(response); });
    auto& responses = study.responses;
    if (match == all_responses.end())
      reader.report_invalid("responses", response_names(), name);
    else if (std::find(responses.begin(), responses.end(), *match) == responses.end())
      responses.push_back(*match);
  }
  if (study.responses.empty()) study.responses = {Response::Pv, Response::Rms};
}

void write_responses(const Study& study, Node::Table& table) {
  Node::Array names;
  for (const Response response : study.responses)
    names.push_back(Node{{}, std::string(name_of(response))});
  put_value(table, "responses", std::move(names));
}

using ResponseLimits = std::vector<std::pair<Response, double>>;

/// Returns the keys of `[limits]`: one for each response that can have an upper limit.
Fields<ResponseLimits> limit_fields() {
  Fields<ResponseLimits> fields;
  for (const Response response : all_responses) {
    if (response == Response::Mean || response == Response::InTolerance) continue;
    Key key = make_key(std::string(name_of(response)) + "_um", Key::Kind::Number,
                       "upper limit; the fraction of machines within it and Cpk are reported");
    key.range = positive;
    fields.custom_field(
        {key},
        [key, response](TableReader& reader, ResponseLimits& limits) {
          if (const auto limit = reader.maybe_number(key.name, key.range))
            limits.emplace_back(response, *limit);
        },
        [key, response](const ResponseLimits& limits, Node::Table& table) {
          for (const auto& [limited_response, limit] : limits)
            if (limited_response == response)
              put_value(table, key.name, limit / sim::unit_factor(key.name));
        });
  }
  return fields;
}

Fields<Tolerance> tolerance_fields() {
  return Fields<Tolerance>()
      .choice("response", &Tolerance::response, {{"pv", Response::Pv}, {"rms", Response::Rms}},
              "figure of the map that is limited")
      .number(required_key("limit_um"), &Tolerance::limit, positive, "limit of that figure")
      .number("confidence", &Tolerance::confidence, confidence_range,
              "fraction of the machines within it")
      .integer("machines", &Tolerance::machines, 200, 1'000'000,
               "random machines from which the spreads are found; as many new ones verify them");
}

/// Evenly spaced values of a sweep whose values are not listed.
struct ValueRange {
  double from = 0.0, to = 0.0;
  int steps = 11;
};

const Fields<ValueRange>& value_range_fields() {
  static const Fields<ValueRange> fields =
      Fields<ValueRange>()
          .number(required_key("from"), &ValueRange::from, any_number,
                  "first value, unless `values` are given")
          .number(required_key("to"), &ValueRange::to, any_number, "last value")
          .integer("steps", &ValueRange::steps, 2, 10000, "number of values from `from` to `to`")
          .check([](TableReader& reader, ValueRange& value_range) {
            if (!std::isfinite(value_range.to - value_range.from))
              reader.report_invalid("to", "a range of finite length",
                                    fmt::format("{} to {}", value_range.from, value_range.to));
          });
  return fields;
}

std::vector<Key> sweep_keys() {
  std::vector<Key> keys{
      make_key(required_key("input"), Key::Kind::Text, "name of the input that is swept"),
      make_key("values", Key::Kind::Numbers, "its values")};
  for (Key key : value_range_fields().keys()) {
    key.required = false;
    keys.push_back(std::move(key));
  }
  return keys;
}

/// Reads a `[[sweep]]`, whose values are listed or evenly spaced.
void read_sweep(const Node& node, Study& study, InputErrors& input_errors) {
  TableReader reader(node, "sweep", input_errors);
  Sweep sweep;
  sweep.input = read_input_index(reader, "input", study.inputs);
  if (reader.has("values")) {
    sweep.values = reader.numbers("values");
  } else {
    const ValueRange value_range = value_range_fields().read(reader);
    sweep.values = Eigen::VectorXd::LinSpaced(Eigen::Index(value_range.steps), value_range.from,
                                              value_range.to);
  }
  reader.close();
  if (study.sweeps.size() == max_sweeps)
    input_errors.add(node.position, fmt::format("at most {} sweeps", max_sweeps), "more");
  if (study.sweeps.size() < max_sweeps) study.sweeps.push_back(std::move(sweep));
}

/// Returns the key `sweep`, a list of tables that refer to inputs by name.
Fields<Study>::Field sweep_field() {
  Key key = make_key("sweep", Key::Kind::Tables,
                     "varies an input over its values, with all others at their centres");
  key.keys = sweep_keys();
  return {{key},
          [](TableReader& reader, Study& study) {
            for (const Node* node : reader.tables("sweep"))
              read_sweep(*node, study, reader.input_errors());
          },
          [](const Study& study, Node::Table& table) {
            Node::Array sweeps;
            for (const Sweep& sweep : study.sweeps) {
              Node::Table sweep_table;
              put_value(sweep_table, "input", study.inputs[std::size_t(sweep.input)].name);
              put_numbers(sweep_table, "values", sweep.values, 1.0);
              sweeps.push_back(Node{{}, std::move(sweep_table)});
            }
            if (!sweeps.empty()) put_value(table, "sweep", std::move(sweeps));
          }};
}

Fields<InfluenceOptions> influence_fields() {
  using Options = InfluenceOptions;
  return Fields<Options>()
      .number("reach_um", &Options::reach, positive,
              "tool passes within this distance of the first are kept")
      .integer("most_rivals", &Options::max_competing_passes, 1, 64,
               "largest number of passes kept at a vertex")
      .integer("checks", &Options::checks, 0, 1000,
               "random machines that are cut to find where the maps fail")
      .number("flag_um", &Options::flag_threshold, positive,
              "a vertex that differs by more in one of them is flagged")
      .boolean("sheet", &Options::has_overview_sheet, "all inputs on one sheet")
      .texts("pictures", &Options::pictures, "names of inputs with a picture of their own");
}

Fields<Histories> histories_fields() {
  return Fields<Histories>()
      .texts(required_key("train"), &Histories::train,
             "variants whose days train the belief, `\"\"` for the scene's own day; a day has "
             "`[[instrument]]`s that read the machine at three or more `start_h`, or all day")
      .texts(required_key("test"), &Histories::test, "variants whose days are judged")
      .text("case", &Histories::case_name, "a compensator with the belief `thermal` alone")
      .check([](TableReader& reader, Histories& histories) {
        for (const auto& [key, list] :
             {std::pair("train", &histories.train), std::pair("test", &histories.test)})
          if (list->empty()) reader.report_missing(key, "a list of variants, \"\" for the scene");
      });
}

/// Adds an input error for each picture of an input that does not exist.
void check_pictures(TableReader& reader, Study& study) {
  const Node* influence = reader.accept_key("influence");
  if (!influence || !influence->table()) return;
  TableReader influence_reader(*influence, "influence", reader.input_errors());
  const std::set<std::string> names = input_names(study.inputs);
  for (const std::string& name : study.influence.pictures)
    if (!names.count(name))
      influence_reader.report_invalid("pictures", "names of inputs", with_suggestion(name, names));
}

}  // namespace

const Fields<Study>& engine_fields() {
  static const Fields<Study> fields =
      Fields<Study>()
          .choice(
              "engine", &Study::engine,
              {{"influence", Engine::Influence, "every machine is computed from influence maps"},
               {"full", Engine::Full,
                "every machine is cut; not for `[worst_case]`, `[tolerance]`, `[uncertainty]`"},
               {"both", Engine::Both,
                "influence maps; the first `proofs` machines of `[monte_carlo]`, which is "
                "required, are cut as well"}},
              "how the cases are computed")
          .integer("seed", &Study::seed, 0, std::numeric_limits<std::int64_t>::max(),
                   "seed of all random numbers; `--seed`")
          .integer("proofs", &Study::verification_cases, 1, max_cases,
                   "machines that `both` cuts as well");
  return fields;
}

const Fields<Distribution>& distribution_fields() {
  using Kind = Distribution::Kind;
  static const Fields<Distribution> fields =
      Fields<Distribution>()
          .choice("distribution", &Distribution::kind,
                  {{"normal", Kind::Normal},
                   {"uniform", Kind::Uniform},
                   {"triangular", Kind::Triangular},
                   {"log_normal", Kind::LogNormal}},
                  "shape of the distribution")
          .number(KeyName("centre").with_fallback(
                      "for `path` the value in the scene, required if it states none (`setup`: 0); "
                      "for `number` 0, for `element` 1"),
                  &Distribution::centre, any_number,
                  "mean, middle, mode or median, within `low` .. `high`; the base machine has "
                  "every input at its centre")
          .number(KeyName("spread"), &Distribution::spread, {0.0, max_spread, true, false},
                  "standard deviation of `normal` before truncation, half width of `uniform` and "
                  "`triangular`, standard deviation of the logarithm of `log_normal` (at most 10), "
                  "in the unit of the path's key; required for `[[input]]`")
          .number("low", &Distribution::low, any_number,
                  "physical limit: nothing is drawn below it")
          .number("high", &Distribution::high, any_number, "nothing is drawn above it")
          .check([](TableReader& reader, Distribution& distribution) {
            if (distribution.centre < distribution.low || distribution.centre > distribution.high)
              reader.report_invalid("centre",
                                    "a centre within low and high, where the base machine is",
                                    fmt::format("{}", distribution.centre));
            if (const char* error = distribution_error(distribution))
              reader.report_invalid("spread", error, distribution_text(distribution));
          });
  return fields;
}

const Fields<Study>& response_fields() {
  static const Fields<Study> fields =
      Fields<Study>()
          .custom_field(
              {make_key(
                  KeyName("responses").with_fallback("[\"pv\", \"rms\"]"), Key::Kind::Texts,
                  "figures of a map: `\"pv\"`, `\"rms\"`, `\"mean\"`, `\"std\"`, `\"max_abs\"`, "
                  "`\"p95_abs\"`, `\"in_tolerance\"`, `\"form_pv\"`, `\"form_rms\"`, "
                  "`\"texture_sa\"`, `\"texture_sq\"`, `\"texture_sz\"`; the areal filter of "
                  "`form_cutoff_mm` separates form from texture, at the part's own vertices")},
              read_responses, write_responses)
          .choice("of", &Study::subtracts_error_free_map,
                  {{"residual", false, "the map as judged in `summary.json`"},
                   {"machine", true, "the map minus the error-free map"}},
                  "map that is judged")
          .table("limits", &Study::limits, limit_fields(), "limits of the requested `responses`");
  return fields;
}

const Fields<Study>& analysis_fields() {
  static const Fields<Study> fields = [] {
    const Fields<Study>::Field sweep = sweep_field();
    return Fields<Study>()
        .table("one_at_a_time", &Study::one_at_a_time,
               Fields<OneAtATime>().number("step", &OneAtATime::step, positive,
                                           "step to either side, in standard deviations"),
               "each input alone, to either side; tornado, root-sum-square and sum")
        .table("monte_carlo", &Study::monte_carlo,
               Fields<MonteCarlo>()
                   .integer("cases", &MonteCarlo::cases, 2, max_cases, "number of random machines")
                   .choice("sampling", &MonteCarlo::sampling,
                           {{"sobol", Sampling::Sobol,
                             "fills the space evenly; its confidence intervals are conservative"},
                            {"random", Sampling::Random}},
                           "sampling method"),
               "random machines: mean, P95, P99 and fraction within the limit, each with its 95 % "
               "confidence interval; Cpk, correlations")
        .table("sobol_indices", &Study::sobol,
               Fields<SobolAnalysis>().integer("base_points", &SobolAnalysis::base_points, 8,
                                               1 << 24, "base points, each with inputs + 2 cases"),
               "fraction of a response's variance due to each input, alone and with its "
               "interactions; inputs must be independent, at most 1800")
        .custom_field(sweep.keys, sweep.read, sweep.write)
        .table("worst_case", &Study::worst_case,
               Fields<WorstCase>().number("coverage", &WorstCase::coverage, positive,
                                          "standard deviations, for a distribution without bounds"),
               "the worst corner of all inputs that is found; with at most 12 inputs every corner "
               "is tried; no corner exceeds the value given as \"at most\"")
        .table("tolerance", &Study::tolerance, tolerance_fields(),
               "required accuracy of each input, with equal ratios and with the least cost; "
               "verified on as many new random machines")
        .table("uncertainty", &Study::uncertainty,
               Fields<Uncertainty>()
                   .number("confidence", &Uncertainty::confidence, confidence_range,
                           "confidence level of the interval")
                   .integer("machines", &Uncertainty::machines, 100, 100'000,
                            "number of random machines"),
               "standard deviation and confidence interval of the map, vertex by vertex")
        .table("influence", &Study::influence, influence_fields(),
               "how the influence maps are made, checked and shown")
        .check(check_pictures)
        .table("histories", &Study::histories, histories_fields(),
               "a thermal belief learnt on some days and judged on others");
  }();
  return fields;
}

std::set<std::string> input_names(const std::vector<Input>& inputs) {
  std::set<std::string> names;
  for (const Input& input : inputs) names.insert(input.name);
  return names;
}

int read_input_index(TableReader& reader, const std::string& key,
                     const std::vector<Input>& inputs) {
  const std::string name = reader.text(key);
  for (std::size_t i = 0; i < inputs.size(); ++i)
    if (inputs[i].name == name) return int(i);
  if (!name.empty())
    reader.report_invalid(key, "the name of an input", with_suggestion(name, input_names(inputs)));
  return 0;
}

std::string with_suggestion(const std::string& name, const std::set<std::string>& known_names) {
  const auto suggestion = nearest(name, known_names);
  return "\"" + name + "\"" + (suggestion ? " (nearest: \"" + *suggestion + "\")" : "");
}

}  // namespace abbe::sim::study
