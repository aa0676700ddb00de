#include "errors/identification/thermal_data.h"

#include <algorithm>
#include <cmath>
#include <optional>
#include <set>
#include <stdexcept>
#include <utility>

#include <fmt/format.h>

#include "kinematics/bad_input.h"
#include "kinematics/text.h"

namespace abbe::errors::identification {

namespace {

using Eigen::Index;

ThermalData select_rows(const ThermalData& data, const std::vector<Index>& rows) {
  ThermalData result{data.names, data.T(rows, Eigen::all), data.y(rows), {}};
  for (const Index row : rows) result.run.push_back(data.run[static_cast<std::size_t>(row)]);
  return result;
}

template <typename Keep>
ThermalData filter_rows(const ThermalData& data, const Keep& keep) {
  std::vector<Index> rows;
  for (Index row = 0; row < data.y.size(); ++row)
    if (keep(data.run[static_cast<std::size_t>(row)])) rows.push_back(row);
  return select_rows(data, rows);
}

constexpr std::size_t max_inputs = 1000;

/// Reader of a log of temperatures and deviations, line by line.
class LogReader {
 public:
  LogReader(std::string file, const ThermalColumns& columns)
      : file_(std::move(file)), columns_(columns) {}

  void read_heads(std::string_view line, int number) {
    std::set<std::string, std::less<>> head_names;
    separator_ = cell_separator(line);
    const std::vector<Cell> cells = split_cells(line, separator_, max_inputs);
    if (cells.size() > max_inputs)
      throw_input_error(number, cells.back().column, fmt::format("at most {} columns", max_inputs),
                        "more");
    for (const Cell& cell : cells) {
      const std::string name(cell.text);
      if (name.empty() || !head_names.insert(name).second)
        throw_input_error(number, cell.column, "a column name that is not used twice",
                          quoted_excerpt(cell.text));
      const auto index = static_cast<int>(kinds_.size());
      const bool ignored = std::ranges::count(columns_.ignored, name) > 0;
      if (name == columns_.run)
        run_ = index;
      else if (name == columns_.y)
        y_ = index;
      else if (!ignored)
        names_.push_back(name);
      kinds_.push_back(ignored ? ColumnKind::Ignored : ColumnKind::Number);
    }
    if (run_ < 0)
      throw_input_error(number, 1, fmt::format("a column {} with the run number", columns_.run),
                        "none");
    if (y_ < 0)
      throw_input_error(number, 1, fmt::format("a column {} with the deviation", columns_.y),
                        "none");
    if (names_.empty()) throw_input_error(number, 1, "a column of temperatures", "none");
  }

  void read_row(std::string_view line, int number) {
    const std::vector<Cell> cells = split_cells(line, separator_, kinds_.size());
    if (cells.size() != kinds_.size())
      throw_input_error(number, cells.back().column,
                        fmt::format("{} cells, as in the header", kinds_.size()),
                        cells.size() > kinds_.size() ? "more" : fmt::format("{}", cells.size()));
    for (std::size_t i = 0; i < cells.size(); ++i) {
      // An ignored column may contain text, such as a time stamp.
      if (kinds_[i] == ColumnKind::Ignored) continue;
      const double value = finite_number(cells[i], number);
      if (static_cast<int>(i) == run_)
        add_run_label(value, cells[i], number);
      else if (static_cast<int>(i) == y_)
        y_of_row_.push_back(value);
      else
        values_.push_back(value);
    }
  }

  ThermalData finish(int lines) const {
    const auto n = static_cast<Index>(run_of_row_.size());
    if (n == 0) throw_input_error(lines, 1, "a row of readings", "none");
    // The values were collected row by row, whereas Eigen matrices store columns by default.
    using RowMajor = Eigen::Matrix<double, Eigen::Dynamic, Eigen::Dynamic, Eigen::RowMajor>;
    return {names_,
            Eigen::Map<const RowMajor>(values_.data(), n, static_cast<Index>(names_.size())),
            Eigen::Map<const Eigen::VectorXd>(y_of_row_.data(), n), run_of_row_};
  }

  [[noreturn]] void throw_input_error(int line, int column, std::string expected,
                                      std::string seen) const {
    throw BadInput(file_, line, column, std::move(expected), std::move(seen));
  }

 private:
  enum class ColumnKind { Number, Ignored };

  double finite_number(const Cell& cell, int line) const {
    const std::optional<double> value = number_of(cell.text);
    if (!value)
      throw_input_error(line, cell.column, "a number within +-1e9", quoted_excerpt(cell.text));
    return *value;
  }

  void add_run_label(double value, const Cell& cell, int line) {
    if (value != std::floor(value) || std::abs(value) > 1e9)
      throw_input_error(line, cell.column, "an integer as the run number",
                        quoted_excerpt(cell.text));
    const int label = static_cast<int>(value);
    // The rows of a run must be contiguous, since lags and start values are computed along them.
    if (run_of_row_.empty() || run_of_row_.back() != label)
      if (!labels_.insert(label).second)
        throw_input_error(line, cell.column, "the rows of each run to be contiguous",
                          fmt::format("run {} again", label));
    run_of_row_.push_back(label);
  }

  std::string file_;
  ThermalColumns columns_;
  char separator_ = ' ';
  std::vector<ColumnKind> kinds_;
  std::vector<std::string> names_;
  int run_ = -1, y_ = -1;
  std::set<int> labels_;
  std::vector<double> values_, y_of_row_;
  std::vector<int> run_of_row_;
};

}  // namespace

void validate(const ThermalData& data) {
  const auto n = data.y.size(), m = data.T.cols();
  require(n >= 1 && m >= 1, "thermal data need at least one row and one input");
  require(data.T.rows() == n && data.run.size() == static_cast<std::size_t>(n) &&
              data.names.size() == static_cast<std::size_t>(m),
          "the sizes of the thermal data do not match");
  require(data.T.allFinite() && data.y.allFinite(),
          "thermal data contain a number that is not finite");
  require(std::set(data.names.begin(), data.names.end()).size() == data.names.size(),
          "two inputs of the thermal data have the same name");
  std::vector<int> starts = data.run;
  // Equal neighbours collapse, so a label that remains twice belongs to separate rows.
  starts.erase(std::unique(starts.begin(), starts.end()), starts.end());
  require(std::set(starts.begin(), starts.end()).size() == starts.size(),
          "the rows of a run of thermal data are not contiguous");
}

std::vector<int> runs(const ThermalData& data) {
  std::vector<int> labels = data.run;
  labels.erase(std::unique(labels.begin(), labels.end()), labels.end());
  return labels;
}

ThermalData select_runs(const ThermalData& data, const std::vector<int>& labels) {
  return filter_rows(data, [&](int run) { return std::ranges::count(labels, run) > 0; });
}

ThermalData exclude_run(const ThermalData& data, int label) {
  return filter_rows(data, [&](int run) { return run != label; });
}

ThermalData select_inputs(const ThermalData& data, const std::vector<int>& inputs) {
  ThermalData result{{}, data.T(Eigen::all, inputs), data.y, data.run};
  for (const int input : inputs)
    result.names.push_back(data.names.at(static_cast<std::size_t>(input)));
  return result;
}

ThermalData thin_runs(const ThermalData& data, int row_stride) {
  require(row_stride >= 1, "thinning must keep every n-th row with n of at least 1");
  std::vector<Index> rows;
  // Counting restarts with every run, so the first row of each run is kept.
  Index start = 0;
  for (Index row = 0; row < data.y.size(); ++row) {
    if (data.run[static_cast<std::size_t>(row)] != data.run[static_cast<std::size_t>(start)])
      start = row;
    if ((row - start) % row_stride == 0) rows.push_back(row);
  }
  return select_rows(data, rows);
}

Spread spread(const Eigen::VectorXd& values) {
  if (values.size() == 0) return {};
  return {std::sqrt(values.squaredNorm() / static_cast<double>(values.size())),
          values.cwiseAbs().maxCoeff()};
}

ThermalData read_thermal_data(std::string_view text, const std::string& file,
                              const ThermalColumns& columns) {
  LogReader reader(file, columns);
  LineReader lines(text);
  bool has_heads = false;
  while (const auto line = lines.next()) {
    const std::size_t first = line->find_first_not_of(" \t");
    if (first == std::string_view::npos || (*line)[first] == '#') continue;
    // The first line that is neither blank nor a comment holds the heads.
    if (has_heads)
      reader.read_row(*line, lines.number());
    else
      reader.read_heads(*line, lines.number());
    has_heads = true;
  }
  if (!has_heads)
    reader.throw_input_error(1, 1, "a header line with column names", "an empty file");
  return reader.finish(lines.number());
}

namespace {

/// Calls visit(first row, row count) for every run.
template <typename Visit>
void for_each_run(const ThermalData& data, const Visit& visit) {
  const auto n = static_cast<Index>(data.run.size());
  for (Index start = 0, end = 0; start < n; start = end) {
    while (end < n &&
           data.run[static_cast<std::size_t>(end)] == data.run[static_cast<std::size_t>(start)])
      ++end;
    visit(start, end - start);
  }
}

/// Returns the temperatures after a first-order lag; exp(-1 / rows) is its exact decay over one
/// row.
Eigen::MatrixXd lagged_temperatures(const ThermalData& data, double rows) {
  Eigen::MatrixXd result = data.T;
  const double decay = std::exp(-1.0 / rows);
  for_each_run(data, [&](Index start, Index count) {
    for (Index row = start + 1; row < start + count; ++row)
      result.row(row) = decay * result.row(row - 1) + (1 - decay) * data.T.row(row);
  });
  return result;
}

}  // namespace

ThermalData with_features(const ThermalData& data, const ThermalFeatures& features) {
  if (!(features.lag_rows >= 0) || !std::isfinite(features.lag_rows))
    throw std::invalid_argument("a lag must be a number of rows of at least 0");
  ThermalData result = data;
  // The temperature at the start of a run serves as its reference.
  if (features.since_start)
    for_each_run(data, [&](Index start, Index count) {
      result.T.middleRows(start, count).rowwise() -= data.T.row(start);
    });
  if (features.lag_rows == 0) return result;
  Eigen::MatrixXd with_lags(result.T.rows(), 2 * result.T.cols());
  with_lags << result.T, lagged_temperatures(result, features.lag_rows);
  result.T = std::move(with_lags);
  for (const std::string& name : data.names) result.names.push_back(name + " lag");
  return result;
}

ThermalData zeroed_at_start(const ThermalData& data) {
  ThermalData result = data;
  for_each_run(data, [&](Index start, Index count) {
    result.y.segment(start, count).array() -= data.y(start);
  });
  return result;
}

}  // namespace abbe::errors::identification
