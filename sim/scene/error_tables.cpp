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

namespace abbe::sim {

namespace {

using Eigen::VectorXd;
using errors::ElementName;
using errors::Shape;

template <typename Series>
Fields<Series> series_fields(const ElementUnits& unit) {
  return Fields<Series>()
      .numbers(must("coefficients" + unit.value), &Series::c, 0, "from order 0")
      .number("centre" + unit.position, &Series::centre, any_number, "where t is 0")
      .number(must("half_range" + unit.position), &Series::half_range, positive,
              "from where t is 0 to where it is 1");
}

// Extends the shorter of A and B with zeros to the length of the other.
void complete(TableReader& reader, errors::Fourier& fourier, const ElementUnits& unit) {
  const std::string a = "a" + unit.value, b = "b" + unit.value;
  // One list is enough, since the other is zero; a curve with neither has no amplitude at all.
  if (!reader.has(a) && !reader.has(b)) reader.missing(a, "an array of numbers, or " + b + ",");
  const Eigen::Index n = std::max(fourier.a.size(), fourier.b.size());
  for (VectorXd* one : {&fourier.a, &fourier.b}) {
    VectorXd whole = VectorXd::Zero(n);
    whole.head(one->size()) = *one;
    *one = std::move(whole);
  }
}

Fields<errors::Fourier> fourier_fields(const ElementUnits& unit) {
  using errors::Fourier;
  // no sampling resolves a period below a thousandth of a mm or a degree
  constexpr Range period{1e-3, 1e9};
  const auto orders_key = [](const std::string& key) { return KeyName(key).otherwise("zeros"); };
  return Fields<Fourier>()
      .number(must("period" + unit.position), &Fourier::period, period, "of order 1")
      .numbers(orders_key("a" + unit.value), &Fourier::a, 0,
               "of the cosines of orders 1, 2, ...; one of the two lists at least")
      .numbers(orders_key("b" + unit.value), &Fourier::b, 0, "of the sines of orders 1, 2, ...")
      .check([unit](TableReader& reader, Fourier& fourier) { complete(reader, fourier, unit); });
}

struct Rows {
  VectorXd q;
  VectorXd value;
};

std::optional<Rows> rows_of_file(TableReader& reader, const ElementName& name) {
  ElementName column = name;
  const std::string wanted = reader.text("column", to_string(name));
  try {
    column = errors::parse_element_name(wanted);
  } catch (const std::invalid_argument& fault) {
    reader.refuse("column", "a column named as an element", fault.what());
  }
  const auto table = read_table_file(reader);
  if (!table) return std::nullopt;
  const auto found = std::find(table->elements.begin(), table->elements.end(), column);
  if (found == table->elements.end()) {
    // The message goes to the key that chose the column.
    reader.refuse(reader.has("column") ? "column" : "file", "a table with the column " + wanted,
                  "none");
    return std::nullopt;
  }
  return Rows{table->q, table->values.col(found - table->elements.begin())};
}

std::optional<Rows> rows_as_written(TableReader& reader, const ElementUnits& unit) {
  Rows rows{reader.numbers("q" + unit.position), reader.numbers("value" + unit.value)};
  // Positions and values form the rows together, so their numbers must match.
  if (rows.q.size() == rows.value.size()) return rows;
  reader.refuse("value" + unit.value, fmt::format("as many values as positions, {}", rows.q.size()),
                fmt::format("{}", rows.value.size()));
  return std::nullopt;
}

errors::Table read_rows(TableReader& reader, const ElementName& name, const ElementUnits& unit,
                        const errors::Table& how) {
  const std::string key = reader.has("file") ? "file" : "q" + unit.position;
  auto rows = reader.has("file") ? rows_of_file(reader, name) : rows_as_written(reader, unit);
  if (!rows) return {};
  const bool missing = rows->q.isZero() && rows->value.isZero() && !reader.has(key);
  if (missing) return {};  // reported already
  try {
    // The table is built by its own module, so the tests for rising positions are made once.
    return errors::make_table(std::move(rows->q), std::move(rows->value), how.between, how.outside);
  } catch (const std::invalid_argument& fault) {
    reader.refuse(key, "a table with rising positions and at least 2 rows", fault.what());
    return {};
  }
}

Fields<errors::Table> table_fields(const ElementName& name, const ElementUnits& unit) {
  using errors::Table;
  const std::string q = "q" + unit.position, value = "value" + unit.value;
  Key file = table_file_key();
  // `file` is an alternative to rows written in the scene.
  file.required = false;
  file.either = "rows";
  const std::vector<Key> keys{
      make_key(KeyName(q).one_of("rows"), Key::Kind::Numbers, "positions of the axis, rising"),
      make_key(value, Key::Kind::Numbers, "of the element, one for each position"),
      file,
      make_key(KeyName("column").otherwise("the element's own"), Key::Kind::Text,
               "of the file, named as an element"),
  };
  return interpolation_fields<Table>().custom(
      keys,
      [name, unit](TableReader& reader, Table& table) {
        table = read_rows(reader, name, unit, table);
      },
      [q, value](const Table& from, Node::Table& to) {
        put_numbers(to, q, from.q, unit_of(q));
        put_numbers(to, value, from.value, unit_of(value));
      });
}

/// Returns the field `seed` with the given value as its default.
template <typename T>
Fields<T> seed_fields(std::uint64_t seed) {
  return Fields<T>()
      // The check runs before the key is read, so the derived seed remains where no key states
      // another.
      .check([seed](TableReader&, T& shape) { shape.seed = seed; })
      .whole(KeyName("seed").otherwise("from the scene's"), &T::seed, 0,
             std::numeric_limits<std::int64_t>::max(), "curves of equal seed move together");
}

Fields<errors::Asynchronous> asynchronous_fields(const ElementName& name, const ElementUnits& unit,
                                                 std::uint64_t seed) {
  using errors::Asynchronous;
  return Fields<Asynchronous>()
      .number(must("rms" + unit.value), &Asynchronous::rms, non_negative, "over many turns")
      .all_of(std::identity{}, seed_fields<Asynchronous>(seed))
      .number("lowest_order", &Asynchronous::lowest_order, positive, "of the cosines, per turn")
      .number("highest_order", &Asynchronous::highest_order, positive,
              "of the cosines, per turn; at most 10000")
      .check([name, unit](TableReader& reader, Asynchronous&) {
        // The orders count per turn, which a slide does not have.
        if (unit.position != "_deg")
          reader.refuse("kind", "\"asynchronous\" on an axis that turns", to_string(name));
      });
}

std::vector<Alternative<Shape>> shapes(const ElementName& name, const ElementUnits& unit,
                                       std::uint64_t seed) {
  const Fields<errors::Table> rows = table_fields(name, unit);
  auto table = alternative<Shape>("table", rows, "values at positions");
  // `detrend` belongs to the curve and not to the table, but the manual lists it with the table.
  for (const Key& key : detrend_fields<CurveEntry>().keys()) table.word.keys.push_back(key);
  return {
      alternative<Shape>(
          "constant",
          Fields<errors::Constant>().number(must("value" + unit.value), &errors::Constant::value,
                                            any_number, "wherever the axis is"),
          "the same everywhere"),
      alternative<Shape>("polynomial", series_fields<errors::Polynomial>(unit),
                         "sum of powers of t = (q - centre)/half range"),
      alternative<Shape>("legendre", series_fields<errors::Legendre>(unit),
                         "sum of Legendre polynomials of t = (q - centre)/half range"),
      alternative<Shape>("fourier", fourier_fields(unit), "sum of cosines and sines"),
      table,
      alternative<Shape>(
          "backlash",
          Fields<errors::Backlash>().number(must("half" + unit.value), &errors::Backlash::half,
                                            any_number, "+ while moving up, - while moving down"),
          "depends on the way of approach"),
      alternative<Shape>(
          "up_down",
          Fields<errors::DirectionalTables>()
              .table(must("up"), &errors::DirectionalTables::up, rows, "while moving up")
              .table(must("down"), &errors::DirectionalTables::down, rows, "while moving down"),
          "a table for each way of approach"),
      alternative<Shape>("repeatability",
                         Fields<errors::Repeatability>()
                             .number(must("sigma" + unit.value), &errors::Repeatability::sigma,
                                     non_negative, "standard deviation")
                             .all_of(std::identity{}, seed_fields<errors::Repeatability>(seed)),
                         "chance, one draw a stroke"),
      alternative<Shape>(
          "asynchronous", asynchronous_fields(name, unit, seed),
          "of a spindle or another axis that turns, over its angle counted on: 32 cosines of "
          "seeded orders a turn, none a whole number"),
  };
}

}  // namespace

Key table_file_key() {
  return make_key(must("file"), Key::Kind::Text,
                  "CSV with the head `X EXX EYX EZX EAX EBX ECX`, mm and rad, positions in mm and "
                  "degrees; a head may give other units, `EXX_um`");
}

std::optional<errors::ElementTable> read_table_file(TableReader& reader) {
  const std::string file = reader.text("file");
  if (file.empty()) return std::nullopt;
  try {
    return errors::read_element_table_file(file);
  } catch (const BadInput& fault) {
    // Without a line number the file as a whole is at fault, so the key gets the message.
    if (fault.line == 0) {
      reader.refuse("file", fault.expected, file + ": " + fault.seen);
    } else {
      reader.input_errors().add(fault);
    }
    return std::nullopt;
  }
}

Fields<CurveEntry> curve_fields(const ElementName& name, const ElementUnits& units,
                                std::uint64_t seed) {
  using errors::Curve;
  const auto curve =
      Fields<Curve>()
          .text("name", &Curve::name, "of the curve, for reports")
          .all_of(std::identity{}, argument_fields<Curve>())
          .number("scale", &Curve::scale, any_number, "factor of the curve")
          .kinds(must("kind"), &Curve::shape, shapes(name, units, seed), "shape of the curve");
  const auto read_detrend = [](TableReader& reader, CurveEntry& to) {
    // Only a table has a straight line that can be removed from it.
    if (std::holds_alternative<errors::Table>(to.curve.shape))
      to = detrend_fields<CurveEntry>().read(reader, std::move(to));
  };
  return Fields<CurveEntry>().all_of(&CurveEntry::curve, curve).check(read_detrend);
}

std::vector<Key> curve_keys() {
  // The keys appear with both units, because the manual describes curves of angles and lengths
  // together.
  const std::vector<Key> keys = curve_fields({}, {"_um", "_mm"}, 0).keys();
  return with_other_unit(with_other_unit(keys, "um", "urad"), "mm", "deg");
}

namespace {

using Eigen::Index;
using errors::Element;

/// The covariance matrix in the form of the file.
struct Uncertainties {
  std::vector<errors::Coefficient> of;  ///< (m)
  VectorXd sigma;                       ///< (m) um or urad
  std::optional<VectorXd> correlation;  ///< (m (m - 1) / 2) lower triangle, row by row
};

double unit_of_number(const errors::Coefficient& number, const std::vector<Element>& elements) {
  return elements[std::size_t(number.element)].name.is_angle() ? units::urad : units::um;
}

std::vector<errors::Coefficient> known_numbers(TableReader& reader, const Node& of,
                                               const std::vector<Element>& elements) {
  std::map<std::string, errors::Coefficient> known;
  std::set<std::string> names;
  for (const errors::Coefficient& one : errors::coefficients(elements)) {
    known.emplace(errors::name_of(one, elements), one);
    names.insert(errors::name_of(one, elements));
  }
  std::vector<errors::Coefficient> numbers;
  if (!of.array()) reader.refuse("of", "a list of names such as \"EXX[1]\"", shown(of));
  for (const Node& name : of.array() ? *of.array() : Node::Array{}) {
    const auto found = name.text() ? known.find(*name.text()) : known.end();
    if (found == known.end()) {
      // A suggestion helps with long names such as `EXX screw pitch cos 1`.
      const auto meant = name.text() ? nearest(*name.text(), names) : std::nullopt;
      reader.input_errors().add(name.place, "a number of this file's curves such as \"EXX[1]\"",
                                shown(name) + (meant ? " (did you mean " + *meant + "?)" : ""));
      continue;
    }
    if (std::find(numbers.begin(), numbers.end(), found->second) != numbers.end())
      reader.input_errors().add(name.place, "each number once", shown(name) + " again");
    // A repeated number is added nevertheless, so that the lengths of the following arrays agree.
    numbers.push_back(found->second);
  }
  return numbers;
}

Fields<Uncertainties> covariance_fields(const std::vector<Element>& elements) {
  const auto read_uncertainties = [elements](TableReader& reader, Uncertainties& to) {
    const Node* of = reader.accept_key("of");
    if (!of) reader.missing("of", "a list of names such as \"EXX[1]\"");
    if (of) to.of = known_numbers(reader, *of, elements);
  };
  const auto write_uncertainties = [elements](const Uncertainties& from, Node::Table& to) {
    Node::Array names;
    for (const errors::Coefficient& one : from.of)
      names.push_back(Node{{}, errors::name_of(one, elements)});
    put(to, "of", std::move(names));
  };
  const auto read_matrix = [](TableReader& reader, Uncertainties& to) {
    const int m = int(to.of.size());
    to.sigma = reader.numbers("standard_uncertainty_um_urad", m);
    // A single number has no correlation, and an empty list would not parse as one.
    if (m > 1) to.correlation = reader.maybe_numbers("correlation", m * (m - 1) / 2);
  };
  const auto write_matrix = [](const Uncertainties& from, Node::Table& to) {
    put_numbers(to, "standard_uncertainty_um_urad", from.sigma, 1.0);
    if (from.correlation) put_numbers(to, "correlation", *from.correlation, 1.0);
  };
  return Fields<Uncertainties>()
      .custom(
          {make_key(must("of"), Key::Kind::Texts,
                    "numbers of the file's curves: `EXX[2]` (order, or row of a table), `EXC cos "
                    "1`, `EXX backlash`, `EC0Y`; of a named curve among several `EXX screw pitch "
                    "cos 1`")},
          read_uncertainties, write_uncertainties)
      .custom(
          {make_key(must("standard_uncertainty_um_urad"), Key::Kind::Numbers,
                    "one for each, >= 0, in um or urad as its element is; 0: zero by convention"),
           make_key(KeyName("correlation").otherwise("none"), Key::Kind::Numbers,
                    "lower triangle without the diagonal, row by row, m (m - 1)/2 numbers; a "
                    "negative variance is refused")},
          read_matrix, write_matrix);
}

}  // namespace

errors::Covariance read_covariance(const Node& table, const std::vector<Element>& elements,
                                   InputErrors& input_errors) {
  TableReader reader(table, "errors.covariance", input_errors);
  const std::size_t before = input_errors.list().size();
  auto [of, sigma, correlation] = covariance_fields(elements).read(reader);
  reader.close();
  // The arrays below have consistent lengths only after an error-free reading.
  if (input_errors.list().size() != before) return {};
  if ((sigma.array() < 0.0).any())
    reader.refuse("standard_uncertainty_um_urad", "numbers >= 0", "a negative one");
  const auto m = Index(of.size());
  for (Index i = 0; i < m; ++i) sigma[i] *= unit_of_number(of[std::size_t(i)], elements);
  Eigen::MatrixXd R = Eigen::MatrixXd::Identity(m, m);
  Index at = 0;
  for (Index i = 0; i < m && correlation; ++i)
    for (Index k = 0; k < i; ++k) R(i, k) = R(k, i) = (*correlation)[at++];
  // A small negative eigenvalue is tolerated, since the numbers in the file are rounded.
  if (eigenvalues(R)[0] < -1e-9 * double(m))
    reader.refuse("correlation", "a correlation that can be (no negative variance)", "another");
  return {std::move(of), sigma.asDiagonal() * R * sigma.asDiagonal()};
}

Node::Table written_covariance(const errors::Covariance& covariance,
                               const std::vector<Element>& elements) {
  const auto m = Index(covariance.of.size());
  const VectorXd sigma = covariance.matrix.diagonal().cwiseSqrt();
  Uncertainties written{covariance.of, sigma, std::nullopt};
  for (Index i = 0; i < m; ++i)
    written.sigma[i] /= unit_of_number(covariance.of[std::size_t(i)], elements);
  VectorXd correlation = VectorXd::Zero(m * (m - 1) / 2);
  Index at = 0;
  for (Index i = 0; i < m; ++i) {
    for (Index k = 0; k < i; ++k, ++at) {
      // A number of zero variance has no defined correlation and stays at zero.
      const double most = sigma[i] * sigma[k];
      if (most > 0.0) correlation[at] = covariance.matrix(i, k) / most;
    }
  }
  // An uncorrelated matrix is written without the key, which is its default.
  if (!correlation.isZero(0.0)) written.correlation = std::move(correlation);
  return covariance_fields(elements).written(written);
}

std::vector<Key> covariance_keys() { return covariance_fields({}).keys(); }

namespace {

constexpr const char* unidentified_name = "unidentified";

UnidentifiedNumber read_number(const Node& node, InputErrors& input_errors) {
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
  // Several tables of errors form one section, so the numbers are collected over all of them.
  if (errors.array())
    for (const Node& table : *errors.array())
      for (UnidentifiedNumber& one : unidentified_numbers(table)) numbers.push_back(std::move(one));
  const Node* list = errors.table() ? errors.find(unidentified_name) : nullptr;
  for (const Node& node : list && list->array() ? *list->array() : Node::Array{}) {
    // Errors are dropped here because the reader of the errors table reports them.
    InputErrors input_errors;
    UnidentifiedNumber number = read_number(node, input_errors);
    if (input_errors.empty()) numbers.push_back(std::move(number));
  }
  return numbers;
}

void read_unidentified(TableReader& reader) {
  // The numbers are read for their errors only; studies read them again from the tree.
  for (const Node* node : reader.tables(unidentified_name))
    read_number(*node, reader.input_errors());
}

Key unidentified_key() {
  Key key = make_key(unidentified_name, Key::Kind::Tables,
                     "numbers at 0 that the readings behind a belief could not tell, as `abbe "
                     "identify` writes them; a study asks for a prior of them");
  key.keys = {make_key(must("number"), Key::Kind::Text, "`EY0A`, `EAX[1]`"),
              make_key("hidden_by", Key::Kind::Texts,
                       "numbers that took on a part of it, none: no reading feels it"),
              make_key("amounts", Key::Kind::Numbers,
                       "how much of each, um or urad a um or urad of the number")};
  return key;
}

std::string unidentified_lines(const std::vector<UnidentifiedNumber>& numbers) {
  if (numbers.empty()) return "";
  std::string text = "unidentified = [\n";
  for (const UnidentifiedNumber& one : numbers) {
    text += fmt::format("  {{ number = {}", to_toml_value(one.number));
    std::string names, amounts;
    for (const auto& [name, amount] : one.hidden_by) {
      names += (names.empty() ? "" : ", ") + to_toml_value(name);
      amounts += fmt::format("{}{}", amounts.empty() ? "" : ", ", amount);
    }
    if (!names.empty()) text += fmt::format(", hidden_by = [{}], amounts = [{}]", names, amounts);
    text += " },\n";
  }
  return text + "]\n";
}

}  // namespace abbe::sim
