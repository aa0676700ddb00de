#pragma once

#include <vtkImageData.h>
#include <vtkNew.h>
#include <vtkPNGReader.h>
#include "render/picture.h"
#include "render/residual_field.h"
#include "tests/test.h"

namespace abbe::render::test {

/// A folder of its own for each test, gone afterwards. There is no display while it lives.
class Folder : public testing::Test {
 protected:
  Folder() {
    ::unsetenv("DISPLAY");
    const auto* info = testing::UnitTest::GetInstance()->current_test_info();
    path_ = fs::temp_directory_path() /
            ("abbe-render-" + std::to_string(::getpid()) + "-" + info->name());
    fs::create_directories(path_);
  }
  ~Folder() override { fs::remove_all(path_); }

  fs::path file(const std::string& name) const { return path_ / name; }

 private:
  fs::path path_;
};

inline std::string bytes(const fs::path& path) {
  std::ifstream stream(path, std::ios::binary);
  return {std::istreambuf_iterator<char>(stream), {}};
}

struct Pixel {
  int r = 0, g = 0, b = 0;

  bool is_white() const { return r >= 254 && g >= 254 && b >= 254; }
  bool is_grey() const { return std::abs(r - g) <= 3 && std::abs(g - b) <= 3 && r > 90 && r < 140; }
  bool is_reddish() const { return r > b + 60 && r > g + 40; }
  bool is_blueish() const { return b > r + 60; }
};

inline int distance(const Pixel& p, const Colour& c) {
  const auto d = [](int seen, double part) {
    return std::abs(seen - static_cast<int>(255.0 * part + 0.5));
  };
  return std::max({d(p.r, c.r), d(p.g, c.g), d(p.b, c.b)});
}

/// A PNG read back through VTK's reader; pixels count from the lower left corner.
class Image {
 public:
  explicit Image(const fs::path& path) {
    reader_->SetFileName(path.c_str());
    reader_->Update();
    reader_->GetOutput()->GetDimensions(size_.data());
  }
  int width() const { return size_[0]; }
  int height() const { return size_[1]; }
  Pixel at(int x, int y) const {
    const auto* p = static_cast<unsigned char*>(reader_->GetOutput()->GetScalarPointer(x, y, 0));
    return {p[0], p[1], p[2]};
  }
  /// Pixels with lower <= x, y < upper for which `is` holds.
  template <class Predicate>
  int count(std::array<int, 2> lower, std::array<int, 2> upper, Predicate is) const {
    int found = 0;
    for (int y = lower[1]; y < upper[1]; ++y) {
      for (int x = lower[0]; x < upper[0]; ++x) found += is(at(x, y)) ? 1 : 0;
    }
    return found;
  }
  template <class Predicate>
  int count(Predicate is) const {
    return count({0, 0}, {width(), height()}, is);
  }

 private:
  vtkNew<vtkPNGReader> reader_;
  std::array<int, 3> size_{};
};

/// A rectangle in z = 0 (nx x ny vertices), lifted by z(x, y), with deviation d(x, y).
template <class Height, class Deviation>
Field sheet(double size_x, double size_y, int nx, int ny, Height z, Deviation d) {
  Field f;
  const int n = nx * ny;
  f.design.vertices.resize(n, 3);
  f.design.triangles.resize(2 * (nx - 1) * (ny - 1), 3);
  f.design.area = VectorXd::Constant(n, size_x * size_y / n);
  f.deviation_um.resize(n);
  f.cut_time_s = VectorXd::LinSpaced(n, 0.0, 100.0);
  f.status.assign(n, 0);
  f.cut_line.assign(n, 7);
  int k = 0;
  for (int i = 0; i < ny; ++i) {
    for (int j = 0; j < nx; ++j) {
      const double x = size_x * (j / (nx - 1.0) - 0.5);
      const double y = size_y * (i / (ny - 1.0) - 0.5);
      const int v = i * nx + j;
      f.design.vertices.row(v) << x, y, z(x, y);
      f.deviation_um[v] = d(x, y);
      if (i == 0 || j == 0) continue;
      f.design.triangles.row(k++) << v - nx - 1, v - nx, v;
      f.design.triangles.row(k++) << v - nx - 1, v, v - 1;
    }
  }
  return f;
}

inline double flat(double, double) { return 0.0; }

/// A round cap of a sphere of radius 120, rim radius 50, about `rings` * 4 `rings` vertices.
template <class Deviation>
Field dome(int rings, Deviation d) {
  Field f;
  const int sectors = 4 * rings;
  const int n = rings * sectors;
  f.design.vertices.resize(n, 3);
  f.design.normals.resize(n, 3);
  f.design.triangles.resize(2 * (rings - 1) * sectors, 3);
  f.deviation_um.resize(n);
  f.cut_time_s = VectorXd::Zero(n);
  f.status.assign(n, 0);
  f.cut_line.assign(n, 1);
  int k = 0;
  for (int i = 0; i < rings; ++i) {
    for (int j = 0; j < sectors; ++j) {
      const double r = 50.0 * (i + 0.01) / (rings - 0.99);
      const double a = 2.0 * 3.14159265358979 * j / sectors;
      const Eigen::RowVector3d p(r * std::cos(a), r * std::sin(a),
                                 std::sqrt(120.0 * 120.0 - r * r) - 120.0);
      const int v = i * sectors + j;
      f.design.vertices.row(v) = p;
      f.design.normals.row(v) = (p + Eigen::RowVector3d(0, 0, 120.0)) / 120.0;
      f.deviation_um[v] = d(p.x(), p.y());
      if (i == 0) continue;
      const int next = i * sectors + (j + 1) % sectors;
      f.design.triangles.row(k++) << v - sectors, v, next;
      f.design.triangles.row(k++) << v - sectors, next, next - sectors;
    }
  }
  f.design.area = VectorXd::Ones(n);
  return f;
}

inline void leave_uncut(Field& f, int vertex) {
  f.status[vertex] = 1;
  f.deviation_um[vertex] = std::numeric_limits<double>::quiet_NaN();
  f.cut_time_s[vertex] = std::numeric_limits<double>::quiet_NaN();
  f.cut_line[vertex] = 0;
}

}  // namespace abbe::render::test
