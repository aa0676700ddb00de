#include "sim/scene/scene_curves.h"

#include <algorithm>
#include <stdexcept>

#include <fmt/format.h>

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

// A and B of equal length; the shorter is filled with zeros.
void complete(TableReader& reader, errors::Fourier& fourier, const ElementUnits& unit) {
  const std::string a = "a" + unit.value, b = "b" + unit.value;
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
  // shorter than a thousandth of a mm or a degree no sampling follows
  constexpr Range period{1e-3, 1e9};
  const auto of_orders = [](const std::string& key) { return KeyName(key).otherwise("zeros"); };
  return Fields<Fourier>()
      .number(must("period" + unit.position), &Fourier::period, period, "of order 1")
      .numbers(of_orders("a" + unit.value), &Fourier::a, 0,
               "of the cosines of orders 1, 2, ...; one of the two lists at least")
      .numbers(of_orders("b" + unit.value), &Fourier::b, 0, "of the sines of orders 1, 2, ...")
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
    reader.refuse(reader.has("column") ? "column" : "file", "a table with the column " + wanted,
                  "none");
    return std::nullopt;
  }
  return Rows{table->q, table->values.col(found - table->elements.begin())};
}

std::optional<Rows> rows_as_written(TableReader& reader, const ElementUnits& unit) {
  Rows rows{reader.numbers("q" + unit.position), reader.numbers("value" + unit.value)};
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
  if (missing) return {};  // which is reported
  try {
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
  file.required = false;
  file.either = "rows";
  const std::vector<Key> keys{
      key_of(KeyName(q).one_of("rows"), Key::Kind::Numbers, "positions of the axis, rising"),
      key_of(value, Key::Kind::Numbers, "of the element, one for each position"),
      file,
      key_of(KeyName("column").otherwise("the element's own"), Key::Kind::Text,
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

/// `seed`, else the one that is given.
template <typename T>
Fields<T> seed_fields(std::uint64_t seed) {
  return Fields<T>()
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
        if (unit.position != "_deg")
          reader.refuse("kind", "\"asynchronous\" on an axis that turns", to_string(name));
      });
}

std::vector<Alternative<Shape>> shapes(const ElementName& name, const ElementUnits& unit,
                                       std::uint64_t seed) {
  const Fields<errors::Table> rows = table_fields(name, unit);
  auto table = alternative<Shape>("table", rows, "values at positions");
  for (const Key& key : detrend_fields<CurveAsWritten>().keys()) table.word.keys.push_back(key);
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
      alternative<Shape>("up_down",
                         Fields<errors::UpDown>()
                             .table(must("up"), &errors::UpDown::up, rows, "while moving up")
                             .table(must("down"), &errors::UpDown::down, rows, "while moving down"),
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
  return key_of(must("file"), Key::Kind::Text,
                "CSV with the head `X EXX EYX EZX EAX EBX ECX`, mm and rad, positions in mm and "
                "degrees; a head may give other units, `EXX_um`");
}

std::optional<errors::ElementTable> read_table_file(TableReader& reader) {
  const std::string file = reader.text("file");
  if (file.empty()) return std::nullopt;
  try {
    return errors::read_element_table_file(file);
  } catch (const BadInput& fault) {
    if (fault.line == 0) {
      reader.refuse("file", fault.expected, file + ": " + fault.seen);
    } else {
      reader.faults().add(fault);
    }
    return std::nullopt;
  }
}

Fields<CurveAsWritten> curve_fields(const ElementName& name, const ElementUnits& units,
                                    std::uint64_t seed) {
  using errors::Curve;
  const auto curve =
      Fields<Curve>()
          .text("name", &Curve::name, "of the curve, for reports")
          .all_of(std::identity{}, argument_fields<Curve>())
          .number("scale", &Curve::scale, any_number, "factor of the curve")
          .kinds(must("kind"), &Curve::shape, shapes(name, units, seed), "shape of the curve");
  const auto read_detrend = [](TableReader& reader, CurveAsWritten& to) {
    if (std::holds_alternative<errors::Table>(to.curve.shape))
      to = detrend_fields<CurveAsWritten>().read(reader, std::move(to));
  };
  return Fields<CurveAsWritten>().all_of(&CurveAsWritten::curve, curve).check(read_detrend);
}

std::vector<Key> curve_keys() {
  const std::vector<Key> keys = curve_fields({}, {"_um", "_mm"}, 0).keys();
  return with_other_unit(with_other_unit(keys, "um", "urad"), "mm", "deg");
}

}  // namespace abbe::sim
