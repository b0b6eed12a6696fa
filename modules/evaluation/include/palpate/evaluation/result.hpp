#pragma once

#include "palpate/model/tissue.hpp"

#include <Eigen/Core>

#include <array>
#include <memory>
#include <optional>
#include <string>
#include <vector>

namespace palpate::evaluation {

struct Column {
  std::string name;
  std::string unit;  ///< empty for counts and ratios
  std::vector<double> values;
};

/// Numbers under named columns of one length; NaN where there is none.
struct Table {
  std::string name;
  std::vector<Column> columns;

  std::size_t rows() const noexcept { return columns.empty() ? 0 : columns.front().values.size(); }
  /// Throws Error(internal) for a column that is not there.
  const Column& column(const std::string& column_name) const;
};
/// A header line "step (s),threshold (s^-2)", then a line a row, ten digits,
/// nothing for NaN. Lines end with "\n".
std::string to_csv(const Table& table);

struct Axis {
  std::string title;  ///< with its unit
  bool logarithmic = false;
  std::optional<std::array<double, 2>> range;
};

struct Series {
  std::string name;
  std::vector<double> x, y;
  bool line = true;
  bool markers = true;
  bool dashed = false;
  std::optional<int> color;  ///< series that belong together share one
};

/// What is drawn of a table.
struct Plot {
  std::string name;
  std::string title;
  Axis x, y;
  std::vector<Series> series;
};

/// Tissue as a run left it, to be drawn with its points coloured by `values`.
struct Shape {
  std::string name;
  std::shared_ptr<const model::Tissue> tissue;
  std::shared_ptr<const std::vector<Eigen::Vector3f>> positions_mm;
  std::vector<float> values;  ///< displacement in mm, one a point
};

/// A number that the figure comes down to.
struct Finding {
  std::string name;  ///< a slug: "order-rk4"
  std::string text;  ///< for people, without the number
  double value = 0.0;
  std::string unit;
};

struct Result {
  std::string name;           ///< of the experiment
  std::vector<Table> tables;  ///< the first bears the experiment's name
  std::vector<Plot> plots;    ///< the first bears the experiment's name
  std::vector<Shape> shapes;
  std::vector<Finding> findings;

  /// Throws Error(internal) for a finding that is not there.
  const Finding& finding(const std::string& finding_name) const;
};

}  // namespace palpate::evaluation
