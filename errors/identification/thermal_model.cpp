#include "errors/identification/thermal_model.h"

#include <algorithm>
#include <charconv>
#include <cmath>
#include <limits>
#include <optional>
#include <set>
#include <stdexcept>
#include <utility>

#include <fmt/format.h>

#include "kinematics/bad_input.h"
#include "kinematics/text.h"

// Thermal models: their fits, predictions and validation, and the text format in which they are
// saved.

namespace abbe::errors::identification {

namespace {

using Eigen::Index;
using Eigen::MatrixXd;
using Eigen::VectorXd;

/// Returns the standard deviation of centred values; 1 if they are constant, so that scaling by it
/// gives 0 and not NaN.
double finite_sd(const VectorXd& centred) {
  const double sd = std::sqrt(centred.squaredNorm() / static_cast<double>(centred.size()));
  return sd > 0 ? sd : 1.0;
}

Scaling data_scaling(const ThermalData& data) {
  Scaling s{data.T.colwise().mean(), VectorXd(data.T.cols()), data.y.mean(), 1.0};
  for (Index j = 0; j < data.T.cols(); ++j)
    s.scale(j) = finite_sd(data.T.col(j).array() - s.mean(j));
  s.y_scale = finite_sd(data.y.array() - s.y_mean);
  return s;
}

MatrixXd scale_inputs(const Scaling& s, const MatrixXd& T) {
  return (T.rowwise() - s.mean.transpose()).array().rowwise() / s.scale.transpose().array();
}

/// Returns every k-th row of each run, with the smallest k that leaves at most about `max_rows`
/// rows; every run keeps at least one.
ThermalData thin_to(const ThermalData& data, int max_rows) {
  const auto n = static_cast<int>(data.y.size());
  return n <= max_rows ? data : thin_runs(data, (n + max_rows - 1) / max_rows);
}

ThermalFit fit_linear(const ThermalData& data, ThermalModel model) {
  ThermalFit result;
  Regression regression = fit_regression(data.T, data.y);
  result.confounded = regression.confounded;
  if (regression.status == RegressionStatus::TooFewRows) result.status = FitStatus::TooFewRows;
  if (regression.status == RegressionStatus::RankDeficient)
    result.status = FitStatus::RankDeficient;
  if (result.status != FitStatus::Ok) return result;
  // The stored covariance is relative to the variance of a reading, as leverage() uses it.
  const double variance = regression.residual_sd * regression.residual_sd;
  model.law = LinearLaw{regression.constant, regression.beta,
                        variance > 0 ? MatrixXd(regression.covariance / variance)
                                     : MatrixXd::Zero(data.T.cols() + 1, data.T.cols() + 1)};
  model.sigma = regression.residual_sd;
  result.regression = std::move(regression);
  result.model = std::move(model);
  return result;
}

ThermalFit fit_shrinkage(const ThermalData& data, const ThermalModelOptions& options,
                         ThermalModel model) {
  const ShrunkFit shrinkage_fit =
      options.kind == ModelKind::Ridge
          ? fit_ridge(data.T, data.y, options.penalty)
          : fit_lasso(data.T, data.y, options.penalty * max_penalty(data.T, data.y));
  ThermalFit result;
  if (!shrinkage_fit.converged) {
    result.status = FitStatus::NotConverged;
    return result;
  }
  model.law = LinearLaw{shrinkage_fit.constant, shrinkage_fit.beta, {}};
  result.model = std::move(model);
  return result;
}

ThermalFit fit_learned_model(const ThermalData& data, const ThermalModelOptions& options,
                             ThermalModel model) {
  const ThermalData thinned_data = thin_to(data, options.max_rows);
  const Scaling s = data_scaling(thinned_data);
  const MatrixXd Z = scale_inputs(s, thinned_data.T);
  // Kernels and networks have no units, so inputs and outputs are scaled to standard deviation 1.
  const VectorXd y = (thinned_data.y.array() - s.y_mean) / s.y_scale;
  if (options.kind == ModelKind::SupportVectors)
    model.law = KernelLaw{s, fit_support_vectors(Z, y, options.support)};
  else if (options.kind == ModelKind::KernelRidge)
    model.law = KernelLaw{s, fit_kernel_ridge(Z, y, options.kernel_ridge)};
  else
    model.law = NetworkLaw{s, fit_network(Z, y, options.network)};
  ThermalFit result;
  result.model = std::move(model);
  return result;
}

/// Returns how far an input lies beyond its trained range, as a fraction of that range; infinite if
/// the input was constant in training and now differs.
double relative_excess(const ThermalModel& model, Index input, double T) {
  const double excess = std::max({model.lowest(input) - T, T - model.highest(input), 0.0});
  // A constant input that has not changed would give 0 / 0.
  return excess == 0 ? 0.0 : excess / (model.highest(input) - model.lowest(input));
}

double law_value(const LinearLaw& law, const VectorXd& T) { return law.constant + law.beta.dot(T); }
double law_value(const KernelLaw& law, const VectorXd& T) {
  return law.scaling.y_mean +
         law.scaling.y_scale *
             value(law.sum, (T - law.scaling.mean).cwiseQuotient(law.scaling.scale));
}
double law_value(const NetworkLaw& law, const VectorXd& T) {
  return law.scaling.y_mean +
         law.scaling.y_scale *
             value(law.network, (T - law.scaling.mean).cwiseQuotient(law.scaling.scale));
}
double law_value(const ThermalModel& model, const VectorXd& T) {
  return std::visit([&](const auto& law) { return law_value(law, T); }, model.law);
}

/// Returns the variance of the prediction that is due to the uncertainty of the coefficients,
/// relative to the variance of a reading; 0 without a covariance.
double leverage(const ThermalModel& model, const VectorXd& T) {
  const auto* law = std::get_if<LinearLaw>(&model.law);
  if (!law || law->covariance.size() == 0) return 0.0;
  VectorXd x(T.size() + 1);
  x << 1, T;
  // Rounding can make a tiny variance negative.
  return std::max(x.dot(law->covariance * x), 0.0);
}

}  // namespace

const char* to_string(ModelKind kind) {
  switch (kind) {
    case ModelKind::Linear:
      return "linear";
    case ModelKind::Ridge:
      return "ridge";
    case ModelKind::Lasso:
      return "lasso";
    case ModelKind::SupportVectors:
      return "support_vectors";
    case ModelKind::KernelRidge:
      return "kernel_ridge";
    case ModelKind::Network:
      return "network";
  }
  return "";
}

ThermalFit fit(const ThermalData& data, const ThermalModelOptions& options) {
  validate(data);
  if (!(options.margin >= 0) || !std::isfinite(options.margin) || options.max_rows < 1)
    throw std::invalid_argument("an option of the thermal model is out of range");
  ThermalModel model;
  model.kind = options.kind;
  model.names = data.names;
  model.lowest = data.T.colwise().minCoeff();
  model.highest = data.T.colwise().maxCoeff();
  model.margin = options.margin;
  const bool is_shrinkage = options.kind == ModelKind::Ridge || options.kind == ModelKind::Lasso;
  ThermalFit result = options.kind == ModelKind::Linear ? fit_linear(data, std::move(model))
                      : is_shrinkage ? fit_shrinkage(data, options, std::move(model))
                                     : fit_learned_model(data, options, std::move(model));
  if (!result.model) return result;
  // The sigma of a linear fit accounts for its degrees of freedom. The other kinds have no such
  // number, so the plain RMS is used.
  if (options.kind != ModelKind::Linear)
    result.model->sigma = spread(data.y - values(*result.model, data.T)).rms;
  // Rows of a run are correlated, so the scatter within training runs underestimates that of a new
  // run.
  if (options.sigma_from_runs && runs(data).size() >= 2) {
    const Validation validation = cross_validate(data, options);
    result.model->sigma_from_runs = validation.status == FitStatus::Ok;
    if (result.model->sigma_from_runs) result.model->sigma = validation.overall.rms;
  }
  return result;
}

ThermalPrediction predict(const ThermalModel& model, const VectorXd& T) {
  if (T.size() != model.lowest.size() || !T.allFinite())
    throw std::invalid_argument("a prediction needs one finite value per trained input");
  ThermalPrediction result;
  // The farthest of several inputs outside the range is reported.
  double farthest = model.margin;
  for (Index i = 0; i < T.size(); ++i)
    if (const double excess = relative_excess(model, i, T(i)); excess > farthest) {
      result.status = PredictionStatus::OutsideTrainedRange;
      result.input = static_cast<int>(i);
      farthest = excess;
    }
  if (result.status != PredictionStatus::Ok) return result;
  result.value = law_value(model, T);
  result.sigma = model.sigma * std::sqrt(1.0 + leverage(model, T));
  return result;
}

VectorXd values(const ThermalModel& model, const MatrixXd& T) {
  VectorXd result(T.rows());
  for (Index row = 0; row < T.rows(); ++row) result(row) = law_value(model, T.row(row).transpose());
  return result;
}

namespace {

/// Returns the number of rows that `predict` rejects.
int count_rows_outside(const ThermalModel& model, const MatrixXd& T) {
  int row_count = 0;
  for (Index row = 0; row < T.rows(); ++row)
    row_count += predict(model, T.row(row).transpose()).status != PredictionStatus::Ok;
  return row_count;
}

/// Residuals of runs that were left out of the training.
struct ValidationPart {
  int run_label = 0;
  FitStatus status = FitStatus::Ok;
  VectorXd residual;
  int rows_outside = 0;  ///< number of rows outside the trained range
};

/// Returns the residuals of a fitted model on test data.
ValidationPart test_residuals(const ThermalFit& thermal_fit, const ThermalData& test,
                              int run_label) {
  if (!thermal_fit.model) return {run_label, thermal_fit.status, {}, 0};
  return {run_label, FitStatus::Ok, test.y - values(*thermal_fit.model, test.T),
          count_rows_outside(*thermal_fit.model, test.T)};
}

/// Fits a model on training data and returns its residuals on test data.
ValidationPart validate_left_out(const ThermalData& training, const ThermalData& test,
                                 ThermalModelOptions options, int run_label) {
  options.sigma_from_runs = false;
  return test_residuals(fit(training, options), test, run_label);
}

/// Returns the figures of all parts together. If a part has no fit, returns only its status.
Validation summary(const std::vector<ValidationPart>& parts) {
  Validation result;
  double squares = 0;
  for (const ValidationPart& part : parts) {
    // A mean over the remaining parts would be too favourable.
    if (part.status != FitStatus::Ok) {
      result = {};
      result.status = part.status;
      return result;
    }
    const Spread part_spread = spread(part.residual);
    squares += static_cast<double>(part.residual.size()) * part_spread.rms * part_spread.rms;
    result.run.push_back(part.run_label);
    result.run_spread.push_back(part_spread);
    result.overall.max = std::max(result.overall.max, part_spread.max);
    result.rows += static_cast<int>(part.residual.size());
    result.outside += part.rows_outside;
  }
  result.overall.rms = std::sqrt(squares / static_cast<double>(result.rows));
  return result;
}

}  // namespace

Validation cross_validate(const ThermalData& data, const ThermalModelOptions& options) {
  const std::vector<int> run_labels = runs(data);
  if (run_labels.size() < 2)
    throw std::invalid_argument("cross-validation by run needs at least two runs");
  std::vector<ValidationPart> parts;
  for (const int run_label : run_labels)
    parts.push_back(validate_left_out(exclude_run(data, run_label), select_runs(data, {run_label}),
                                      options, run_label));
  return summary(parts);
}

Validation validate_on(const ThermalData& training, const ThermalData& test, const Recipe& recipe) {
  validate(test);
  const ThermalData training_data = with_features(training, recipe.features);
  const ThermalData test_data = with_features(test, recipe.features);
  // Equal names in another order would still assign temperatures to wrong coefficients.
  if (training_data.names != test_data.names)
    throw std::invalid_argument("training and test data differ in their inputs");
  ThermalModelOptions options = recipe.model;
  options.sigma_from_runs = false;
  const ThermalFit fitted = fit(training_data, options);
  std::vector<ValidationPart> parts;
  for (const int run_label : runs(test_data))
    parts.push_back(test_residuals(fitted, select_runs(test_data, {run_label}), run_label));
  return summary(parts);
}

namespace {

// Text format: every line is a keyword with its values, in a fixed order. A number is written as
// the shortest decimal that reads back to the same bits.

constexpr int max_model_size = 1000;
constexpr int max_support_rows = 100'000;

constexpr ModelKind model_kinds[] = {ModelKind::Linear,      ModelKind::Ridge,
                                     ModelKind::Lasso,       ModelKind::SupportVectors,
                                     ModelKind::KernelRidge, ModelKind::Network};

/// Writes the lines of a model.
class Writer {
 public:
  void line(std::string_view keyword, std::string_view value) {
    text_ += fmt::format("{} {}\n", keyword, value);
  }
  void number(std::string_view keyword, double value) { line(keyword, fmt::format("{}", value)); }
  void vector(std::string_view keyword, const VectorXd& values) {
    text_ += keyword;
    for (const double value : values) text_ += fmt::format(" {}", value);
    text_ += '\n';
  }
  void matrix(std::string_view keyword, const MatrixXd& rows) {
    line(keyword, fmt::format("{}", rows.rows()));
    for (Index row = 0; row < rows.rows(); ++row) vector("row", rows.row(row).transpose());
  }

  void law(const LinearLaw& law) {
    number("constant", law.constant);
    vector("beta", law.beta);
    matrix("covariance", law.covariance);
  }
  void law(const KernelLaw& law) {
    scaling(law.scaling);
    number("gamma", law.sum.gamma);
    number("bias", law.sum.bias);
    line("supports", fmt::format("{}", law.sum.weight.size()));
    vector("weight", law.sum.weight);
    matrix("support", law.sum.support);
  }
  void law(const NetworkLaw& law) {
    scaling(law.scaling);
    number("out_bias", law.network.out_bias);
    line("hidden", fmt::format("{}", law.network.out.size()));
    vector("out", law.network.out);
    vector("in_bias", law.network.in_bias);
    matrix("in", law.network.in);
  }
  std::string take_text() { return std::move(text_); }

 private:
  void scaling(const Scaling& s) {
    vector("mean", s.mean);
    vector("scale", s.scale);
    number("y_mean", s.y_mean);
    number("y_scale", s.y_scale);
  }
  std::string text_;
};

/// Reads the lines of a model in their order. Each function throws BadInput if the next line is not
/// as expected.
class Reader {
 public:
  Reader(std::string_view text, const std::string& file) : lines_(text), file_(file) {
    check_encoding(text, file);
  }

  /// Returns the text after the keyword on the next line.
  std::string_view value_text(std::string_view keyword) {
    const std::optional<std::string_view> line = lines_.next();
    if (!line) throw_input_error(fmt::format("a line \"{} ...\"", keyword), "the end");
    if (line->substr(0, keyword.size()) != keyword ||
        (line->size() > keyword.size() && (*line)[keyword.size()] != ' '))
      throw_input_error(fmt::format("a line \"{} ...\"", keyword), quoted_excerpt(*line));
    line_ = *line;
    return line->substr(std::min(line->size(), keyword.size() + 1));
  }

  VectorXd vector(std::string_view keyword, Index size) {
    std::string_view remaining = value_text(keyword);
    // Checked before memory is allocated for the values.
    if (static_cast<Index>(remaining.size()) < size)
      throw_input_error(fmt::format("{} finite numbers", size), quoted_excerpt(remaining));
    VectorXd values(size);
    for (Index i = 0; i < size; ++i) {
      while (!remaining.empty() && remaining.front() == ' ') remaining.remove_prefix(1);
      const auto [end, error] =
          std::from_chars(remaining.data(), remaining.data() + remaining.size(), values(i));
      if (error != std::errc() || !std::isfinite(values(i)))
        throw_input_error(fmt::format("{} finite numbers", size), quoted_excerpt(remaining),
                          remaining);
      remaining.remove_prefix(static_cast<std::size_t>(end - remaining.data()));
    }
    if (!remaining.empty())
      throw_input_error(fmt::format("{} finite numbers", size), quoted_excerpt(remaining),
                        remaining);
    return values;
  }
  double number(std::string_view keyword) { return vector(keyword, 1)(0); }
  double positive(std::string_view keyword) {
    const double value = number(keyword);
    if (!(value > 0)) throw_input_error("a number above 0", fmt::format("{}", value));
    return value;
  }
  double not_negative(std::string_view keyword) {
    const double value = number(keyword);
    if (!(value >= 0)) throw_input_error("a number of at least 0", fmt::format("{}", value));
    return value;
  }
  int integer(std::string_view keyword, int min, int max) {
    const double value = number(keyword);
    if (value != std::floor(value) || value < min || value > max)
      throw_input_error(fmt::format("an integer from {} to {}", min, max),
                        fmt::format("{}", value));
    return static_cast<int>(value);
  }
  /// Each row is read before memory for the next is allocated, so a text cannot demand more memory
  /// than its own size justifies.
  MatrixXd matrix(std::string_view keyword, Index columns, int max_rows) {
    const int count = integer(keyword, 0, max_rows);
    std::vector<VectorXd> rows;
    for (int row = 0; row < count; ++row) rows.push_back(vector("row", columns));
    MatrixXd result(count, count ? columns : 0);
    for (int row = 0; row < count; ++row)
      result.row(row) = rows[static_cast<std::size_t>(row)].transpose();
    return result;
  }
  void finish() {
    while (const auto line = lines_.next())
      if (!line->empty()) throw_input_error("the end", quoted_excerpt(*line));
  }

  [[noreturn]] void throw_input_error(const std::string& expected, const std::string& seen,
                                      std::string_view at = {}) const {
    const int column = at.data() && !line_.empty() ? int(at.data() - line_.data()) + 1 : 1;
    throw BadInput(file_, lines_.number(), column, expected, seen);
  }

 private:
  LineReader lines_;
  std::string_view line_;
  std::string file_;
};

ModelKind read_kind(Reader& reader) {
  const std::string_view keyword = reader.value_text("kind");
  for (const ModelKind kind : model_kinds)
    if (keyword == to_string(kind)) return kind;
  reader.throw_input_error("a kind of model", quoted_excerpt(keyword));
}

LinearLaw read_linear(Reader& reader, Index m) {
  LinearLaw law;
  law.constant = reader.number("constant");
  law.beta = reader.vector("beta", m);
  // Shrunk models have no covariance, so the matrix may be empty.
  law.covariance = reader.matrix("covariance", m + 1, static_cast<int>(m) + 1);
  if (law.covariance.rows() != 0 && law.covariance.rows() != m + 1)
    reader.throw_input_error(fmt::format("no covariance or a covariance of {} rows", m + 1),
                             fmt::format("{}", law.covariance.rows()));
  return law;
}

Scaling read_scaling(Reader& reader, Index m) {
  Scaling s;
  s.mean = reader.vector("mean", m);
  s.scale = reader.vector("scale", m);
  if (!(s.scale.array() > 0).all())
    reader.throw_input_error("only scales above 0", "a scale of at most 0");
  s.y_mean = reader.number("y_mean");
  s.y_scale = reader.positive("y_scale");
  return s;
}

KernelLaw read_kernel(Reader& reader, Index m) {
  KernelLaw law{read_scaling(reader, m), {}};
  law.sum.gamma = reader.positive("gamma");
  law.sum.bias = reader.number("bias");
  const int count = reader.integer("supports", 0, max_support_rows);
  law.sum.weight = reader.vector("weight", count);
  law.sum.support = reader.matrix("support", m, max_support_rows);
  if (law.sum.support.rows() != count)
    reader.throw_input_error(fmt::format("{} supports", count),
                             fmt::format("{}", law.sum.support.rows()));
  return law;
}

NetworkLaw read_network(Reader& reader, Index m) {
  NetworkLaw law{read_scaling(reader, m), {}};
  law.network.out_bias = reader.number("out_bias");
  const int hidden = reader.integer("hidden", 1, max_model_size);
  law.network.out = reader.vector("out", hidden);
  law.network.in_bias = reader.vector("in_bias", hidden);
  law.network.in = reader.matrix("in", m, max_model_size);
  if (law.network.in.rows() != hidden)
    reader.throw_input_error(fmt::format("{} rows", hidden),
                             fmt::format("{}", law.network.in.rows()));
  return law;
}

std::vector<std::string> read_names(Reader& reader, int count) {
  std::vector<std::string> names;
  std::set<std::string_view> earlier_names;
  for (int i = 0; i < count; ++i) {
    const std::string_view name = reader.value_text("input");
    if (!earlier_names.insert(name).second)
      reader.throw_input_error("an input name that is not used twice", quoted_excerpt(name));
    names.emplace_back(name);
  }
  return names;
}

}  // namespace

std::string to_text(const ThermalModel& model) {
  Writer writer;
  writer.line("abbe", "thermal model 1");
  writer.line("kind", to_string(model.kind));
  writer.line("inputs", fmt::format("{}", model.names.size()));
  for (const std::string& name : model.names) writer.line("input", name);
  writer.vector("lowest", model.lowest);
  writer.vector("highest", model.highest);
  writer.number("margin", model.margin);
  writer.number("sigma", model.sigma);
  writer.line("sigma_from_runs", model.sigma_from_runs ? "1" : "0");
  std::visit([&](const auto& law) { writer.law(law); }, model.law);
  return writer.take_text();
}

ThermalModel parse_thermal_model(std::string_view text, const std::string& file) {
  Reader reader(text, file);
  if (const std::string_view head = reader.value_text("abbe"); head != "thermal model 1")
    reader.throw_input_error("a first line \"abbe thermal model 1\"", quoted_excerpt(head));
  ThermalModel model;
  model.kind = read_kind(reader);
  const int m = reader.integer("inputs", 1, max_model_size);
  model.names = read_names(reader, m);
  model.lowest = reader.vector("lowest", m);
  model.highest = reader.vector("highest", m);
  if (!(model.lowest.array() <= model.highest.array()).all())
    reader.throw_input_error("every highest value at or above its lowest",
                             "a highest value below its lowest");
  model.margin = reader.not_negative("margin");
  model.sigma = reader.not_negative("sigma");
  model.sigma_from_runs = reader.integer("sigma_from_runs", 0, 1) == 1;
  if (model.kind == ModelKind::SupportVectors || model.kind == ModelKind::KernelRidge)
    model.law = read_kernel(reader, m);
  else if (model.kind == ModelKind::Network)
    model.law = read_network(reader, m);
  else
    model.law = read_linear(reader, m);
  reader.finish();
  return model;
}

}  // namespace abbe::errors::identification
