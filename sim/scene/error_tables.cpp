#include "sim/scene/error_tables.h"

#include <algorithm>
#include <map>
#include <optional>
#include <set>
#include <stdexcept>

#include <fmt/format.h>

#include "errors/coefficients.h"
#include "kinematics/decompositions.h"
#include "kinematics/units.h"
#include "sim/scene/fields.h"
#include "sim/scene/toml.h"

// Keys of the curves of error elements, of the covariance of their coefficients, and of
// unidentified coefficients.

namespace abbe::sim {

namespace {

using Eigen::VectorXd;
using errors::ElementName;
using errors::Shape;

template <typename Polynomial>
Fields<Polynomial> polynomial_fields(const ElementUnits& unit) {
  return Fields<Polynomial>()
      .numbers(required_key("coefficients" + unit.value), &Polynomial::c, 0,
               "coefficients from order 0 upwards")
      .number("centre" + unit.position, &Polynomial::centre, any_number, "position at which t is 0")
      .number(required_key("half_range" + unit.position), &Polynomial::half_range, positive,
              "distance from the position at which t is 0 to that at which it is 1");
}

// Pads the shorter list of amplitudes with zeros. One of the two lists must be stated.
void pad_amplitudes(TableReader& reader, errors::Fourier& fourier, const ElementUnits& unit) {
  const std::string a = "a" + unit.value, b = "b" + unit.value;
  if (!reader.has(a) && !reader.has(b))
    reader.report_missing(a, "an array of numbers, or " + b + ",");
  const Eigen::Index n = std::max(fourier.a.size(), fourier.b.size());
  for (VectorXd* amplitudes : {&fourier.a, &fourier.b}) {
    VectorXd padded = VectorXd::Zero(n);
    padded.head(amplitudes->size()) = *amplitudes;
    *amplitudes = std::move(padded);
  }
}

Fields<errors::Fourier> fourier_fields(const ElementUnits& unit) {
  using errors::Fourier;
  // No sampling of an axis resolves a period below a thousandth of a mm or a degree.
  constexpr Range period{1e-3, 1e9};
  const auto orders_key = [](const std::string& key) {
    return KeyName(key).with_fallback("zeros");
  };
  return Fields<Fourier>()
      .number(required_key("period" + unit.position), &Fourier::period, period, "period of order 1")
      .numbers(orders_key("a" + unit.value), &Fourier::a, 0,
               "amplitudes of the cosines of orders 1, 2, ...; at least one of the two lists is "
               "required")
      .numbers(orders_key("b" + unit.value), &Fourier::b, 0,
               "amplitudes of the sines of orders 1, 2, ...")
      .check(
          [unit](TableReader& reader, Fourier& fourier) { pad_amplitudes(reader, fourier, unit); });
}

/// Rows of a table of one element.
struct Rows {
  VectorXd q;
  VectorXd value;
};

/// Reads rows from a column of a file.
std::optional<Rows> read_file_rows(TableReader& reader, const ElementName& name) {
  ElementName column = name;
  const std::string column_name = reader.text("column", to_string(name));
  try {
    column = errors::parse_element_name(column_name);
  } catch (const std::invalid_argument& error) {
    reader.report_invalid("column", "a column named after an element", error.what());
  }
  const auto table = read_element_csv(reader);
  if (!table) return std::nullopt;
  const auto position = std::find(table->elements.begin(), table->elements.end(), column);
  if (position == table->elements.end()) {
    // The error is reported at the key that selects the column.
    reader.report_invalid(reader.has("column") ? "column" : "file",
                          "a table with the column " + column_name, "none");
    return std::nullopt;
  }
  return Rows{table->q, table->values.col(position - table->elements.begin())};
}

/// Reads rows that are written in the scene.
std::optional<Rows> read_scene_rows(TableReader& reader, const ElementUnits& unit) {
  Rows rows{reader.numbers("q" + unit.position), reader.numbers("value" + unit.value)};
  if (rows.q.size() == rows.value.size()) return rows;
  reader.report_invalid("value" + unit.value,
                        fmt::format("as many values as positions, that is {}", rows.q.size()),
                        fmt::format("{}", rows.value.size()));
  return std::nullopt;
}

/// Reads the rows of a table whose interpolation is known.
errors::Table read_rows(TableReader& reader, const ElementName& name, const ElementUnits& unit,
                        const errors::Table& interpolation) {
  const std::string key = reader.has("file") ? "file" : "q" + unit.position;
  auto rows = reader.has("file") ? read_file_rows(reader, name) : read_scene_rows(reader, unit);
  if (!rows) return {};
  // A missing key is reported already and gives zeros.
  if (rows->q.isZero() && rows->value.isZero() && !reader.has(key)) return {};
  try {
    // make_table() tests the rows, so a scene accepts exactly what the models accept.
    return errors::make_table(std::move(rows->q), std::move(rows->value), interpolation.between,
                              interpolation.outside);
  } catch (const std::invalid_argument& error) {
    reader.report_invalid(key, "a table with ascending positions and at least 2 rows",
                          error.what());
    return {};
  }
}

Fields<errors::Table> table_fields(const ElementName& name, const ElementUnits& unit) {
  using errors::Table;
  const std::string q = "q" + unit.position, value = "value" + unit.value;
  Key file = table_file_key();
  // `file` is an alternative to rows written in the scene.
  file.required = false;
  file.exclusive_group = "rows";
  const std::vector<Key> keys{
      make_key(KeyName(q).in_exclusive_group("rows"), Key::Kind::Numbers,
               "positions of the axis, ascending"),
      make_key(value, Key::Kind::Numbers, "values of the element, one per position"),
      file,
      make_key(KeyName("column").with_fallback("name of the element"), Key::Kind::Text,
               "column of the file, named after an element"),
  };
  return interpolation_fields<Table>().custom_field(
      keys,
      [name, unit](TableReader& reader, Table& table) {
        table = read_rows(reader, name, unit, table);
      },
      [q, value](const Table& table, Node::Table& entries) {
        put_numbers(entries, q, table.q, unit_factor(q));
        put_numbers(entries, value, table.value, unit_factor(value));
      });
}

/// Returns the field `seed`, whose default is the given value.
template <typename T>
Fields<T> seed_fields(std::uint64_t seed) {
  return Fields<T>()
      // This step runs before the key is read, so the default remains if the key is missing.
      .check([seed](TableReader&, T& shape) { shape.seed = seed; })
      .integer(KeyName("seed").with_fallback("from the seed of the scene"), &T::seed, 0,
               std::numeric_limits<std::int64_t>::max(),
               "seed of the random numbers; curves with equal seeds vary together");
}

Fields<errors::Asynchronous> asynchronous_fields(const ElementName& name, const ElementUnits& unit,
                                                 std::uint64_t seed) {
  using errors::Asynchronous;
  return Fields<Asynchronous>()
      .number(required_key("rms" + unit.value), &Asynchronous::rms, non_negative,
              "RMS over many revolutions")
      .include_fields(whole_struct, seed_fields<Asynchronous>(seed))
      .number("lowest_order", &Asynchronous::lowest_order, positive,
              "lowest order of the cosines, per revolution")
      .number("highest_order", &Asynchronous::highest_order, positive,
              "highest order of the cosines, per revolution; at most 10000")
      .check([name, unit](TableReader& reader, Asynchronous&) {
        // Orders are per revolution, so a linear axis cannot have any.
        if (unit.position != "_deg")
          reader.report_invalid("kind", "\"asynchronous\" for rotary axes only", to_string(name));
      });
}

std::vector<Alternative<Shape>> shape_alternatives(const ElementName& name,
                                                   const ElementUnits& unit, std::uint64_t seed) {
  const Fields<errors::Table> rows = table_fields(name, unit);
  auto table = alternative<Shape>("table", rows, "values at positions");
  // `detrend` is a field of the curve, but the manual lists it with the table, as only tables have
  // it.
  for (const Key& key : detrend_fields<CurveEntry>().keys()) table.selector.keys.push_back(key);
  return {
      alternative<Shape>("constant",
                         Fields<errors::Constant>().number(required_key("value" + unit.value),
                                                           &errors::Constant::value, any_number,
                                                           "value at every position of the axis"),
                         "the same everywhere"),
      alternative<Shape>("polynomial", polynomial_fields<errors::Polynomial>(unit),
                         "sum of powers of t = (q - centre)/half range"),
      alternative<Shape>("legendre", polynomial_fields<errors::Legendre>(unit),
                         "sum of Legendre polynomials of t = (q - centre)/half range"),
      alternative<Shape>("fourier", fourier_fields(unit), "sum of cosines and sines"),
      table,
      alternative<Shape>("backlash",
                         Fields<errors::Backlash>().number(
                             required_key("half" + unit.value), &errors::Backlash::half, any_number,
                             "half of the backlash: + while moving up, - while moving down"),
                         "depends on the direction of approach"),
      alternative<Shape>("up_down",
                         Fields<errors::DirectionalTables>()
                             .table(required_key("up"), &errors::DirectionalTables::up, rows,
                                    "values while moving up")
                             .table(required_key("down"), &errors::DirectionalTables::down, rows,
                                    "values while moving down"),
                         "one table for each direction of approach"),
      alternative<Shape>(
          "repeatability",
          Fields<errors::Repeatability>()
              .number(required_key("sigma" + unit.value), &errors::Repeatability::sigma,
                      non_negative, "standard deviation")
              .include_fields(whole_struct, seed_fields<errors::Repeatability>(seed)),
          "random, one draw per stroke"),
      alternative<Shape>("asynchronous", asynchronous_fields(name, unit, seed),
                         "for a spindle or another rotary axis, over its accumulated angle: 32 "
                         "cosines with seeded orders per revolution, none of them an integer"),
  };
}

}  // namespace

Key table_file_key() {
  return make_key(required_key("file"), Key::Kind::Text,
                  "CSV file with the header `X EXX EYX EZX EAX EBX ECX`, in mm and rad, positions "
                  "in mm and degrees; a header may state other units, such as `EXX_um`");
}

std::optional<errors::ElementTable> read_element_csv(TableReader& reader) {
  const std::string file = reader.text("file");
  if (file.empty()) return std::nullopt;
  try {
    return errors::read_element_table_file(file);
  } catch (const BadInput& error) {
    // An error without a line number concerns the file as a whole, so it is reported at the key.
    if (error.line == 0) {
      reader.report_invalid("file", error.expected, file + ": " + error.seen);
    } else {
      reader.input_errors().add(error);
    }
    return std::nullopt;
  }
}

Fields<CurveEntry> curve_fields(const ElementName& name, const ElementUnits& units,
                                std::uint64_t seed) {
  using errors::Curve;
  const auto curve = Fields<Curve>()
                         .text("name", &Curve::name, "name of the curve, used in reports")
                         .include_fields(whole_struct, argument_fields<Curve>())
                         .number("scale", &Curve::scale, any_number, "factor of the curve")
                         .variant(required_key("kind"), &Curve::shape,
                                  shape_alternatives(name, units, seed), "shape of the curve");
  const auto read_detrend = [](TableReader& reader, CurveEntry& entry) {
    // A straight line can be removed from tables only.
    if (std::holds_alternative<errors::Table>(entry.curve.shape))
      entry = detrend_fields<CurveEntry>().read(reader, std::move(entry));
  };
  return Fields<CurveEntry>().include_fields(&CurveEntry::curve, curve).check(read_detrend);
}

std::vector<Key> curve_keys() {
  // The manual describes curves of angles and of lengths together, so every key appears with both
  // units.
  const std::vector<Key> keys = curve_fields({}, {"_um", "_mm"}, 0).keys();
  return allow_other_unit(allow_other_unit(keys, "um", "urad"), "mm", "deg");
}

namespace {

using Eigen::Index;
using errors::Element;

/// Covariance matrix in the form of the file: standard uncertainties and correlations.
struct Uncertainties {
  std::vector<errors::Coefficient> coefficients;  ///< (m)
  VectorXd sigma;                                 ///< (m) um or urad
  std::optional<VectorXd> correlation;            ///< (m (m - 1) / 2) lower triangle, row by row
};

/// Returns the unit of a coefficient in the file, um or urad.
double coefficient_unit(const errors::Coefficient& coefficient,
                        const std::vector<Element>& elements) {
  return elements[std::size_t(coefficient.element)].name.is_angle() ? units::urad : units::um;
}

/// Returns the coefficients that a list names.
std::vector<errors::Coefficient> read_coefficient_names(TableReader& reader, const Node& list,
                                                        const std::vector<Element>& elements) {
  std::map<std::string, errors::Coefficient> coefficients_by_name;
  std::set<std::string> names;
  for (const errors::Coefficient& coefficient : errors::coefficients(elements)) {
    coefficients_by_name.emplace(errors::name_of(coefficient, elements), coefficient);
    names.insert(errors::name_of(coefficient, elements));
  }
  std::vector<errors::Coefficient> named_coefficients;
  if (!list.array())
    reader.report_invalid("of", "a list of names such as \"EXX[1]\"", display_text(list));
  for (const Node& name : list.array() ? *list.array() : Node::Array{}) {
    const auto entry =
        name.text() ? coefficients_by_name.find(*name.text()) : coefficients_by_name.end();
    if (entry == coefficients_by_name.end()) {
      // Names may be long, such as `EXX screw pitch cos 1`.
      const auto suggestion = name.text() ? nearest(*name.text(), names) : std::nullopt;
      reader.input_errors().add(
          name.position, "a coefficient of the curves in this file, such as \"EXX[1]\"",
          display_text(name) + (suggestion ? " (did you mean " + *suggestion + "?)" : ""));
      continue;
    }
    if (std::find(named_coefficients.begin(), named_coefficients.end(), entry->second) !=
        named_coefficients.end())
      reader.input_errors().add(name.position, "each number once", display_text(name) + " again");
    // A repeated coefficient is added as well, so that the lengths of the following arrays agree.
    named_coefficients.push_back(entry->second);
  }
  return named_coefficients;
}

Fields<Uncertainties> covariance_fields(const std::vector<Element>& elements) {
  const auto read_names = [elements](TableReader& reader, Uncertainties& uncertainties) {
    const Node* list = reader.accept_key("of");
    if (!list) reader.report_missing("of", "a list of names such as \"EXX[1]\"");
    if (list) uncertainties.coefficients = read_coefficient_names(reader, *list, elements);
  };
  const auto write_names = [elements](const Uncertainties& uncertainties, Node::Table& table) {
    Node::Array names;
    for (const errors::Coefficient& coefficient : uncertainties.coefficients)
      names.push_back(Node{{}, errors::name_of(coefficient, elements)});
    put_value(table, "of", std::move(names));
  };
  const auto read_matrix = [](TableReader& reader, Uncertainties& uncertainties) {
    const int m = int(uncertainties.coefficients.size());
    uncertainties.sigma = reader.numbers("standard_uncertainty_um_urad", m);
    // A single coefficient has no correlations, and a list in the file must not be empty.
    if (m > 1) uncertainties.correlation = reader.maybe_numbers("correlation", m * (m - 1) / 2);
  };
  const auto write_matrix = [](const Uncertainties& uncertainties, Node::Table& table) {
    put_numbers(table, "standard_uncertainty_um_urad", uncertainties.sigma, 1.0);
    if (uncertainties.correlation)
      put_numbers(table, "correlation", *uncertainties.correlation, 1.0);
  };
  return Fields<Uncertainties>()
      .custom_field({make_key(required_key("of"), Key::Kind::Texts,
                              "coefficients of the curves in this file: `EXX[2]` (order, or row of "
                              "a table), `EXC cos 1`, `EXX backlash`, `EC0Y`; for a named curve "
                              "among several, `EXX screw pitch cos 1`")},
                    read_names, write_names)
      .custom_field({make_key(required_key("standard_uncertainty_um_urad"), Key::Kind::Numbers,
                              "one value per coefficient, >= 0, in um or urad according to its "
                              "element; 0: zero by convention"),
                     make_key(KeyName("correlation").with_fallback("none"), Key::Kind::Numbers,
                              "lower triangle without the diagonal, row by row, m (m - 1)/2 "
                              "numbers; negative variances are rejected")},
                    read_matrix, write_matrix);
}

}  // namespace

errors::Covariance read_covariance(const Node& table, const std::vector<Element>& elements,
                                   InputErrors& input_errors) {
  TableReader reader(table, "errors.covariance", input_errors);
  const std::size_t error_count = input_errors.list().size();
  auto [coefficients, sigma, correlation] = covariance_fields(elements).read(reader);
  reader.close();
  // After an input error the lengths of the arrays may differ.
  if (input_errors.list().size() != error_count) return {};
  if ((sigma.array() < 0.0).any())
    reader.report_invalid("standard_uncertainty_um_urad", "numbers >= 0", "a negative number");
  const auto m = Index(coefficients.size());
  for (Index i = 0; i < m; ++i)
    sigma[i] *= coefficient_unit(coefficients[std::size_t(i)], elements);
  Eigen::MatrixXd R = Eigen::MatrixXd::Identity(m, m);
  Index triangle_index = 0;
  for (Index i = 0; i < m && correlation; ++i)
    for (Index k = 0; k < i; ++k) R(i, k) = R(k, i) = (*correlation)[triangle_index++];
  // The numbers in the file are rounded, which may make an eigenvalue slightly negative.
  if (eigenvalues(R)[0] < -1e-9 * double(m))
    reader.report_invalid("correlation", "a valid correlation (no negative variance)", "another");
  return {std::move(coefficients), sigma.asDiagonal() * R * sigma.asDiagonal()};
}

Node::Table covariance_to_table(const errors::Covariance& covariance,
                                const std::vector<Element>& elements) {
  const auto m = Index(covariance.of.size());
  const VectorXd sigma = covariance.matrix.diagonal().cwiseSqrt();
  Uncertainties uncertainties{covariance.of, sigma, std::nullopt};
  for (Index i = 0; i < m; ++i)
    uncertainties.sigma[i] /= coefficient_unit(covariance.of[std::size_t(i)], elements);
  VectorXd correlation = VectorXd::Zero(m * (m - 1) / 2);
  Index triangle_index = 0;
  for (Index i = 0; i < m; ++i) {
    for (Index k = 0; k < i; ++k, ++triangle_index) {
      // The correlation of a coefficient with zero variance is undefined; zero is written.
      const double max_covariance = sigma[i] * sigma[k];
      if (max_covariance > 0.0)
        correlation[triangle_index] = covariance.matrix(i, k) / max_covariance;
    }
  }
  // No correlation is the default of the key.
  if (!correlation.isZero(0.0)) uncertainties.correlation = std::move(correlation);
  return covariance_fields(elements).to_table(uncertainties);
}

std::vector<Key> covariance_keys() { return covariance_fields({}).keys(); }

namespace {

constexpr const char* unidentified_name = "unidentified";

UnidentifiedNumber read_unidentified_number(const Node& node, InputErrors& input_errors) {
  TableReader reader(node, unidentified_name, input_errors);
  UnidentifiedNumber result{reader.text("number"), {}};
  const std::vector<std::string> names = reader.texts("hidden_by");
  if (!names.empty()) {
    const Eigen::VectorXd amounts = reader.numbers("amounts", int(names.size()));
    for (Eigen::Index i = 0; i < amounts.size(); ++i)
      result.hidden_by.emplace_back(names[std::size_t(i)], amounts[i]);
  }
  reader.close();
  return result;
}

}  // namespace

std::vector<UnidentifiedNumber> unidentified_numbers(const Node& errors) {
  std::vector<UnidentifiedNumber> numbers;
  if (errors.array())
    for (const Node& table : *errors.array())
      for (UnidentifiedNumber& number : unidentified_numbers(table))
        numbers.push_back(std::move(number));
  const Node* list = errors.table() ? errors.find(unidentified_name) : nullptr;
  for (const Node& node : list && list->array() ? *list->array() : Node::Array{}) {
    InputErrors input_errors;
    UnidentifiedNumber number = read_unidentified_number(node, input_errors);
    if (input_errors.empty()) numbers.push_back(std::move(number));
  }
  return numbers;
}

void read_unidentified(TableReader& reader) {
  // Only the input errors matter here; studies read the numbers from the tree.
  for (const Node* node : reader.tables(unidentified_name))
    read_unidentified_number(*node, reader.input_errors());
}

Key unidentified_key() {
  Key key =
      make_key(unidentified_name, Key::Kind::Tables,
               "coefficients left at 0 because the readings behind a belief could not identify "
               "them, as written by `abbe identify`; a study requires a prior for each");
  key.keys = {
      make_key(required_key("number"), Key::Kind::Text, "name, such as `EY0A` or `EAX[1]`"),
      make_key("hidden_by", Key::Kind::Texts,
               "coefficients that absorbed part of it; none: it affects no reading"),
      make_key("amounts", Key::Kind::Numbers,
               "change of each, in um or urad per um or urad of the unidentified coefficient")};
  return key;
}

std::string unidentified_lines(const std::vector<UnidentifiedNumber>& numbers) {
  if (numbers.empty()) return "";
  std::string text = "unidentified = [\n";
  for (const UnidentifiedNumber& number : numbers) {
    text += fmt::format("  {{ number = {}", to_toml_value(number.number));
    std::string names, amounts;
    for (const auto& [name, amount] : number.hidden_by) {
      names += (names.empty() ? "" : ", ") + to_toml_value(name);
      amounts += fmt::format("{}{}", amounts.empty() ? "" : ", ", amount);
    }
    if (!names.empty()) text += fmt::format(", hidden_by = [{}], amounts = [{}]", names, amounts);
    text += " },\n";
  }
  return text + "]\n";
}

}  // namespace abbe::sim
