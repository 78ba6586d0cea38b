// The problem of benches/solve.rs in Ceres with derivatives by hand: a 6R chain, 1 000 poses of four markers, 28 unknowns, noise 0.1 mm.
// g++ -O3 -march=native -DNDEBUG chain.cc -o chain $(pkg-config --cflags eigen3) -lceres -lglog && ./chain
#include <ceres/ceres.h>

#include <cstdio>
#include <ctime>
#include <random>

using Eigen::Matrix3d;
using Eigen::Vector3d;
using Basis = Eigen::Matrix<double, 3, 2>;
using Row = Eigen::Matrix<double, 3, 28, Eigen::RowMajor>;

constexpr int kPoses = 1000, kMarkers = 4;
constexpr double kSigma = 1e-4;
// x, y, z, roll, pitch, yaw of the joints, and their axes: the robot of the benchmark.
const Vector3d kSteps[6] = {{0, 0, 0.13}, {0.02, 0.12, 0.05}, {0.03, -0.1, 0.45}, {0.05, 0.02, 0.40}, {0.08, 0.05, 0.10}, {0.02, 0.06, 0.09}};
const Vector3d kTurns[6] = {{0, 0, 0}, {0.1, 0, 0.2}, {0, 0.3, 0}, {0, 0, 0}, {0.2, 0, 0}, {0, 0, 0.1}};
const Vector3d kAxes[6] = {{0, 0, 1}, {0, 1, 0}, Vector3d(0, 1, 0.2).normalized(), Vector3d(1, 0.1, 0).normalized(), {0, 0, 1}, {0, 1, 0}};
constexpr int kLine[6] = {-1, 0, -1, 1, 2, -1};   // joints whose origin is free as a line: two shifts and two turns
const Vector3d kLineAxes[3] = {{0, 1, 0}, {0, 0, 1}, {0, 1, 0}};
constexpr int kOffset[6] = {-1, 0, 1, 2, 3, -1};

Matrix3d Skew(const Vector3d &v) {
  Matrix3d k;
  k << 0, -v.z(), v.y(), v.z(), 0, -v.x(), -v.y(), v.x(), 0;
  return k;
}

// Rotation of a rotation vector, and its left Jacobian.
void Exp(const Vector3d &w, Matrix3d *rotation, Matrix3d *left) {
  const double t = w.norm();
  const Matrix3d k = Skew(w);
  if (t < 1e-7) {
    *rotation = Matrix3d::Identity() + k;
    *left = Matrix3d::Identity() + k / 2;
    return;
  }
  const double s = std::sin(t), c = std::cos(t);
  *rotation = Matrix3d::Identity() + s / t * k + (1 - c) / (t * t) * k * k;
  *left = Matrix3d::Identity() + (1 - c) / (t * t) * k + (t - s) / (t * t * t) * k * k;
}

Basis Across(const Vector3d &axis) {
  Basis b;
  b.col(0) = axis.cross(std::abs(axis.z()) < 0.9 ? Vector3d(0, 0, 1) : Vector3d(1, 0, 0));
  b.col(1) = axis.cross(b.col(0));
  return b;
}

// What does not depend on the pose, once for each evaluation.
struct Shared : ceres::EvaluationCallback {
  double x[28] = {};
  Matrix3d world, world_left, mount, mount_left, turn[3], turned[3];
  Vector3d shift[3];
  Basis basis[3], left[3];
  Matrix3d fixed[6];
  Shared() {
    using Turn = Eigen::AngleAxisd;
    for (int i = 0; i < 6; ++i)
      fixed[i] = (Turn(kTurns[i].z(), Vector3d::UnitZ()) * Turn(kTurns[i].y(), Vector3d::UnitY()) * Turn(kTurns[i].x(), Vector3d::UnitX())).toRotationMatrix();
    for (int i = 0; i < 6; ++i)
      if (kLine[i] >= 0) basis[kLine[i]] = Across(kLineAxes[kLine[i]]);
  }
  void PrepareForEvaluation(bool, bool) override {
    Exp(Vector3d(x + 3), &world, &world_left);
    Exp(Vector3d(x + 9), &mount, &mount_left);
    for (int k = 0; k < 3; ++k) {
      const double *p = x + 16 + 4 * k;
      shift[k] = basis[k] * Eigen::Vector2d(p[0], p[1]);
      Exp(basis[k] * Eigen::Vector2d(p[2], p[3]), &turn[k], &turned[k]);
      left[k] = turned[k] * basis[k];
    }
  }
};

struct Pose : ceres::SizedCostFunction<3 * kMarkers, 28> {
  const Shared *shared;
  const Vector3d *points;
  double q[6];
  Vector3d seen[kMarkers];

  bool Evaluate(double const *const *parameters, double *residuals, double **jacobians) const override {
    const double *x = parameters[0];
    const Shared &s = *shared;
    const bool wanted = jacobians && jacobians[0];
    Matrix3d a = s.world;
    Vector3d at = Vector3d(x);
    // Of each turn: the number of its first unknown, its axes, its origin. Of each shift: number and directions.
    struct { int number, count; Eigen::Matrix<double, 3, 3> axes; Vector3d origin; } turns[9];
    Eigen::Matrix<double, 3, 2> shifts[3];
    int n = 0;
    turns[n++] = {3, 3, s.world_left, at};
    for (int i = 0; i < 6; ++i) {
      at += a * kSteps[i];
      a *= s.fixed[i];
      if (const int k = kLine[i]; k >= 0) {
        shifts[k] = a * s.basis[k];
        at += a * s.shift[k];
        turns[n].number = 18 + 4 * k, turns[n].count = 2, turns[n].origin = at;
        turns[n++].axes.leftCols<2>() = a * s.left[k];
        a *= s.turn[k];
      }
      double angle = q[i];
      if (const int k = kOffset[i]; k >= 0) {
        turns[n].number = 12 + k, turns[n].count = 1, turns[n].origin = at;
        turns[n++].axes.col(0) = a * kAxes[i];
        angle += x[12 + k];
      }
      a *= Eigen::AngleAxisd(angle, kAxes[i]).toRotationMatrix();
    }
    const Matrix3d moved = a;
    at += a * Vector3d(x + 6);
    turns[n++] = {9, 3, a * s.mount_left, at};
    a *= s.mount;
    for (int m = 0; m < kMarkers; ++m) {
      const Vector3d p = at + a * points[m];
      Eigen::Map<Vector3d>(residuals + 3 * m) = (p - seen[m]) / kSigma;
      if (!wanted) continue;
      Eigen::Map<Row> j(jacobians[0] + 84 * m);
      j.leftCols<3>() = Matrix3d::Identity() / kSigma;
      j.middleCols<3>(6) = moved / kSigma;
      for (int k = 0; k < 3; ++k) j.middleCols<2>(16 + 4 * k) = shifts[k] / kSigma;
      for (int t = 0; t < n; ++t)
        for (int c = 0; c < turns[t].count; ++c)
          j.col(turns[t].number + c) = turns[t].axes.col(c).cross(p - turns[t].origin) / kSigma;
    }
    return true;
  }
};

int main() {
  std::mt19937_64 random(1);
  std::normal_distribution<double> normal;
  std::uniform_real_distribution<double> uniform(-1, 1);
  Vector3d points[kMarkers];
  for (auto &p : points) p = 0.05 * Vector3d(uniform(random), uniform(random), uniform(random));
  Shared shared;
  double truth[28];
  for (int i = 0; i < 28; ++i) truth[i] = (i < 12 ? 0.01 : 0.005) * normal(random);
  std::copy(truth, truth + 28, shared.x);
  shared.PrepareForEvaluation(true, true);
  std::vector<Pose> poses(kPoses);
  for (auto &pose : poses) {
    pose.shared = &shared, pose.points = points;
    for (double &q : pose.q) q = 1.4 * uniform(random);
    for (auto &p : pose.seen) p.setZero();
    double e[3 * kMarkers];
    const double *x = shared.x;
    pose.Evaluate(&x, e, nullptr);
    for (int m = 0; m < kMarkers; ++m)
      pose.seen[m] = kSigma * (Eigen::Map<Vector3d>(e + 3 * m) + Vector3d(normal(random), normal(random), normal(random)));
  }
  // The derivatives are right, or their time says nothing.
  {
    double e[2][12], j[12 * 28], *js[1] = {j};
    const double *x = shared.x;
    for (int side : {0, 1}) {
      for (int i = 0; i < 28; ++i) shared.x[i] = truth[i] + (side ? 1e-6 : -1e-6) * (i % 5 - 2);
      shared.PrepareForEvaluation(true, true);
      poses[0].Evaluate(&x, e[side], nullptr);
    }
    std::copy(truth, truth + 28, shared.x);
    shared.PrepareForEvaluation(true, true);
    double r[12];
    poses[0].Evaluate(&x, r, js);
    for (int k = 0; k < 12; ++k) {
      double d = 0;
      for (int i = 0; i < 28; ++i) d += j[28 * k + i] * 2e-6 * (i % 5 - 2);
      if (std::abs(d - (e[1][k] - e[0][k])) > 1e-4) { std::printf("derivative of row %d is wrong: %g, %g\n", k, d, e[1][k] - e[0][k]); return 1; }
    }
  }
  for (const auto kind : {ceres::DENSE_QR, ceres::DENSE_NORMAL_CHOLESKY}) {
    double best = 1e9;
    ceres::Solver::Summary summary;
    for (int run = 0; run < 20; ++run) {
      std::fill(shared.x, shared.x + 28, 0.0);
      ceres::Problem::Options own;
      own.evaluation_callback = &shared;
      own.cost_function_ownership = ceres::DO_NOT_TAKE_OWNERSHIP;
      ceres::Problem problem(own);
      for (auto &pose : poses) problem.AddResidualBlock(&pose, nullptr, shared.x);
      ceres::Solver::Options options;
      options.linear_solver_type = kind;
      options.num_threads = 1;
      options.max_num_iterations = 50;
      // Processor time: other programs on the machine do not count.
      const std::clock_t begun = std::clock();
      ceres::Solve(options, &problem, &summary);
      best = std::min(best, 1e3 * double(std::clock() - begun) / CLOCKS_PER_SEC);
    }
    std::printf("Ceres, %s: %.2f ms, %d steps, residual %.3f sigma\n", ceres::LinearSolverTypeToString(kind), best,
                int(summary.iterations.size()) - 1, std::sqrt(2 * summary.final_cost / (12 * kPoses - 28)));
  }
}
