#include <algorithm>
#include <charconv>
#include <cmath>
#include <optional>
#include <set>
#include <utility>

#include <fmt/format.h>

#include "errors/identification/thermal_model.h"
#include "kinematics/bad_input.h"
#include "kinematics/encoding.h"
#include "kinematics/text.h"

// Every line is a word and numbers, in a fixed order; a number is the shortest decimal that reads
// back as the same bits.
namespace abbe::errors::identification {
namespace {

using Eigen::Index;
using Eigen::MatrixXd;
using Eigen::VectorXd;

constexpr int largest_model = 1000;
constexpr int most_rows = 100'000;

constexpr ModelKind kinds[] = {ModelKind::Linear,      ModelKind::Ridge,
                               ModelKind::Lasso,       ModelKind::SupportVectors,
                               ModelKind::KernelRidge, ModelKind::Network};

class Writer {
 public:
  void line(std::string_view word, std::string_view rest) {
    text_ += fmt::format("{} {}\n", word, rest);
  }
  void number(std::string_view word, double value) { line(word, fmt::format("{}", value)); }
  void vector(std::string_view word, const VectorXd& values) {
    text_ += word;
    for (const double value : values) text_ += fmt::format(" {}", value);
    text_ += '\n';
  }
  void matrix(std::string_view word, const MatrixXd& rows) {
    line(word, fmt::format("{}", rows.rows()));
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
  std::string take() { return std::move(text_); }

 private:
  void scaling(const Scaling& s) {
    vector("mean", s.mean);
    vector("scale", s.scale);
    number("y_mean", s.y_mean);
    number("y_scale", s.y_scale);
  }
  std::string text_;
};

/// Takes the lines in their order.
class Reader {
 public:
  Reader(std::string_view text, const std::string& file) : lines_(text), file_(file) {
    check_encoding(text, file);
  }

  /// What follows the word on the next line.
  std::string_view rest(std::string_view word) {
    const std::optional<std::string_view> line = lines_.next();
    if (!line) refuse(fmt::format("a line \"{} ...\"", word), "the end");
    if (line->substr(0, word.size()) != word ||
        (line->size() > word.size() && (*line)[word.size()] != ' '))
      refuse(fmt::format("a line \"{} ...\"", word), in_quotes(*line));
    line_ = *line;
    return line->substr(std::min(line->size(), word.size() + 1));
  }

  VectorXd vector(std::string_view word, Index size) {
    std::string_view left = rest(word);
    if (static_cast<Index>(left.size()) < size)  // before room is made for them
      refuse(fmt::format("{} finite numbers", size), in_quotes(left));
    VectorXd values(size);
    for (Index i = 0; i < size; ++i) {
      while (!left.empty() && left.front() == ' ') left.remove_prefix(1);
      const auto [end, error] = std::from_chars(left.data(), left.data() + left.size(), values(i));
      if (error != std::errc() || !std::isfinite(values(i)))
        refuse(fmt::format("{} finite numbers", size), in_quotes(left), left);
      left.remove_prefix(static_cast<std::size_t>(end - left.data()));
    }
    if (!left.empty()) refuse(fmt::format("{} finite numbers", size), in_quotes(left), left);
    return values;
  }
  double number(std::string_view word) { return vector(word, 1)(0); }
  double positive(std::string_view word) {
    const double value = number(word);
    if (!(value > 0)) refuse("a number above 0", fmt::format("{}", value));
    return value;
  }
  double not_negative(std::string_view word) {
    const double value = number(word);
    if (!(value >= 0)) refuse("a number of 0 or more", fmt::format("{}", value));
    return value;
  }
  int whole(std::string_view word, int least, int most) {
    const double value = number(word);
    if (value != std::floor(value) || value < least || value > most)
      refuse(fmt::format("a whole number from {} to {}", least, most), fmt::format("{}", value));
    return static_cast<int>(value);
  }
  /// Rows are read before the next is made room for, so a text cannot ask for more than it holds.
  MatrixXd matrix(std::string_view word, Index columns, int most) {
    const int count = whole(word, 0, most);
    std::vector<VectorXd> rows;
    for (int row = 0; row < count; ++row) rows.push_back(vector("row", columns));
    MatrixXd result(count, count ? columns : 0);
    for (int row = 0; row < count; ++row)
      result.row(row) = rows[static_cast<std::size_t>(row)].transpose();
    return result;
  }
  void finish() {
    while (const auto line = lines_.next())
      if (!line->empty()) refuse("the end", in_quotes(*line));
  }

  [[noreturn]] void refuse(const std::string& expected, const std::string& seen,
                           std::string_view at = {}) const {
    const int column = at.data() && !line_.empty() ? int(at.data() - line_.data()) + 1 : 1;
    throw BadInput(file_, lines_.number(), column, expected, seen);
  }

 private:
  Lines lines_;
  std::string_view line_;
  std::string file_;
};

ModelKind read_kind(Reader& reader) {
  const std::string_view word = reader.rest("kind");
  for (const ModelKind kind : kinds)
    if (word == to_string(kind)) return kind;
  reader.refuse("a kind of model", in_quotes(word));
}

LinearLaw read_linear(Reader& reader, Index m) {
  LinearLaw law;
  law.constant = reader.number("constant");
  law.beta = reader.vector("beta", m);
  law.covariance = reader.matrix("covariance", m + 1, static_cast<int>(m) + 1);
  if (law.covariance.rows() != 0 && law.covariance.rows() != m + 1)
    reader.refuse(fmt::format("no covariance or {} rows of it", m + 1),
                  fmt::format("{}", law.covariance.rows()));
  return law;
}

Scaling read_scaling(Reader& reader, Index m) {
  Scaling s;
  s.mean = reader.vector("mean", m);
  s.scale = reader.vector("scale", m);
  if (!(s.scale.array() > 0).all()) reader.refuse("scales above 0", "another");
  s.y_mean = reader.number("y_mean");
  s.y_scale = reader.positive("y_scale");
  return s;
}

KernelLaw read_kernel(Reader& reader, Index m) {
  KernelLaw law{read_scaling(reader, m), {}};
  law.sum.gamma = reader.positive("gamma");
  law.sum.bias = reader.number("bias");
  const int count = reader.whole("supports", 0, most_rows);
  law.sum.weight = reader.vector("weight", count);
  law.sum.support = reader.matrix("support", m, most_rows);
  if (law.sum.support.rows() != count)
    reader.refuse(fmt::format("{} supports", count), fmt::format("{}", law.sum.support.rows()));
  return law;
}

NetworkLaw read_network(Reader& reader, Index m) {
  NetworkLaw law{read_scaling(reader, m), {}};
  law.network.out_bias = reader.number("out_bias");
  const int hidden = reader.whole("hidden", 1, largest_model);
  law.network.out = reader.vector("out", hidden);
  law.network.in_bias = reader.vector("in_bias", hidden);
  law.network.in = reader.matrix("in", m, largest_model);
  if (law.network.in.rows() != hidden)
    reader.refuse(fmt::format("{} rows", hidden), fmt::format("{}", law.network.in.rows()));
  return law;
}

std::vector<std::string> read_names(Reader& reader, int count) {
  std::vector<std::string> names;
  std::set<std::string_view> seen;
  for (int i = 0; i < count; ++i) {
    const std::string_view name = reader.rest("input");
    if (!seen.insert(name).second) reader.refuse("a name that no other input has", in_quotes(name));
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
  return writer.take();
}

ThermalModel thermal_model_of_text(std::string_view text, const std::string& file) {
  Reader reader(text, file);
  if (const std::string_view head = reader.rest("abbe"); head != "thermal model 1")
    reader.refuse("a first line \"abbe thermal model 1\"", in_quotes(head));
  ThermalModel model;
  model.kind = read_kind(reader);
  const int m = reader.whole("inputs", 1, largest_model);
  model.names = read_names(reader, m);
  model.lowest = reader.vector("lowest", m);
  model.highest = reader.vector("highest", m);
  if (!(model.lowest.array() <= model.highest.array()).all())
    reader.refuse("no highest below its lowest", "one");
  model.margin = reader.not_negative("margin");
  model.sigma = reader.not_negative("sigma");
  model.sigma_from_runs = reader.whole("sigma_from_runs", 0, 1) == 1;
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
