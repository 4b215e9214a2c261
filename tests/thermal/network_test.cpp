// SPDX-License-Identifier: MIT
#include "thermal/network.hpp"

#include <gtest/gtest.h>

#include <cmath>

#include "tests/thermal/dual.hpp"
#include "tests/thermal/reference.hpp"
#include "thermal/motor_set.hpp"

namespace {

using dual_test::Dual;
using thermal::Boundary;
using thermal::Drive;
using thermal::HeatInput;
using thermal::HeatNetwork;
using thermal::HeatSet;
using thermal::LinkLaw;
using thermal::SetProblem;

HeatInput<> input_of(double current2_A2, double ambient_degC) {
  HeatInput<> input;
  input[Drive::current_A2] = current2_A2;
  for (Drive phase : {Drive::phase_a_A2, Drive::phase_b_A2, Drive::phase_c_A2}) input[phase] = current2_A2 / 2;
  input[Boundary::ambient] = ambient_degC;
  return input;
}

template <class Scalar>
HeatSet<Scalar> convert(const HeatSet<double>& from) {
  HeatSet<Scalar> to{};
  to.node_count = from.node_count;
  to.link_count = from.link_count;
  to.source_count = from.source_count;
  for (int i = 0; i < from.node_count; ++i)
    to.nodes[i] = {Scalar(from.nodes[i].capacity_J_per_K), from.nodes[i].max_degC};
  for (int i = 0; i < from.link_count; ++i) {
    const auto& l = from.links[i];
    to.links[i] = {l.from, l.to, l.law, Scalar(l.conductance_W_per_K), Scalar(l.k)};
  }
  for (int i = 0; i < from.source_count; ++i) {
    const auto& s = from.sources[i];
    to.sources[i] = {s.node, s.drive, Scalar(s.gain), Scalar(s.coefficient_per_K)};
  }
  to.housing = {from.housing.node, Scalar(0), Scalar(0), Scalar(0)};
  return to;
}

TEST(Network, WithoutCopperCoefficientAnyStepIsExact) {
  wire::Motor m = reference::ec16();
  m.copper_coefficient_per_K = 0;
  const HeatNetwork<double, 2> net(thermal::two_resistor_set(m));
  for (double dt_s : {0.01, 1.0, 50.0, 3000.0}) {
    const Eigen::Vector2d T = net.step(net.transition(dt_s), Eigen::Vector2d(25, 25), input_of(9, 25));
    reference::TwoNodes truth{m};
    truth.advance(dt_s, 20000, 9, 25);
    EXPECT_NEAR(T[0], static_cast<double>(truth.degC[0]), 2e-9) << dt_s;
    EXPECT_NEAR(T[1], static_cast<double>(truth.degC[1]), 2e-9) << dt_s;
  }
}

TEST(Network, TenMillisecondStepsFollowABurstWithResistanceFeedback) {
  const wire::Motor m = reference::ec16();
  const HeatNetwork<double, 2> net(thermal::two_resistor_set(m));
  const auto step = net.transition(0.01);
  Eigen::Vector2d T(25, 25), euler(25, 25);
  reference::TwoNodes truth{m};
  for (int i = 0; i < 36; ++i) {
    T = net.step(step, T, input_of(400, 25));
    euler += 0.01 * Eigen::Vector2d(net.rate_K_per_s(0, euler, input_of(400, 25)),
                                    net.rate_K_per_s(1, euler, input_of(400, 25)));
    truth.advance(0.01L, 10, 400, 25);
  }
  const double true_degC = static_cast<double>(truth.degC[0]);
  EXPECT_GT(true_degC, 120.0);
  EXPECT_NEAR(T[0], true_degC, 5e-3);
  EXPECT_LT(euler[0], true_degC - 0.1) << "explicit Euler under-reads, which is why it is not used";
}

TEST(Network, ThreePhaseSetAgreesWithTheReferenceOnAStalledRotor) {
  wire::Motor m = reference::ec16();
  m.phase_coupling_W_per_K = 0.3;
  const HeatNetwork<double> net(thermal::three_phase_set(m));
  const auto step = net.transition(0.01);
  HeatNetwork<double>::Vector T = HeatNetwork<double>::Vector::Constant(4, 40.0);
  reference::ThreePhases truth{m, {40, 40, 40, 40}};
  HeatInput<> input = input_of(0, 40);
  input[Drive::phase_a_A2] = 16;
  input[Drive::phase_b_A2] = 4;
  input[Drive::phase_c_A2] = 4;
  for (int i = 0; i < 2000; ++i) {
    T = net.step(step, T, input);
    truth.advance(0.01L, 2, {16, 4, 4}, 40);
  }
  for (int k = 0; k < 4; ++k) EXPECT_NEAR(T[k], static_cast<double>(truth.degC[static_cast<std::size_t>(k)]), 1e-4);
  EXPECT_GT(T[0], T[1] + 5);
}

TEST(Network, TightlyCoupledPhasesAreTheTwoResistorMotor) {
  wire::Motor m = reference::ec16();
  const HeatNetwork<double> two(thermal::two_resistor_set(m));
  const auto two_step = two.transition(0.01);
  double difference_K[2];
  for (int loose = 0; loose < 2; ++loose) {
    m.phase_coupling_W_per_K = loose ? 0.3 : 1e5;
    const HeatNetwork<double> three(thermal::three_phase_set(m));
    const auto three_step = three.transition(0.01);
    HeatNetwork<double>::Vector a = HeatNetwork<double>::Vector::Constant(2, 25.0);
    HeatNetwork<double>::Vector b = HeatNetwork<double>::Vector::Constant(4, 25.0);
    for (int i = 0; i < 500; ++i) {
      HeatInput<> input = input_of(40, 25);
      input[Drive::phase_a_A2] = 40;  // stalled on phase a
      input[Drive::phase_b_A2] = input[Drive::phase_c_A2] = 10;
      a = two.step(two_step, a, input);
      b = three.step(three_step, b, input);
    }
    difference_K[loose] = std::abs(a[0] - b[0]);
    EXPECT_NEAR(a[1], b[3], loose ? 1.0 : 1e-3);
  }
  EXPECT_LT(difference_K[0], 1e-3);
  EXPECT_GT(difference_K[1], 10.0);
}

TEST(Network, FixedAndDynamicSizeGiveTheSameDigits) {
  const auto set = thermal::two_resistor_set(reference::powermax());
  const HeatNetwork<double, 2> fixed(set);
  const HeatNetwork<double> dynamic(set);
  Eigen::Vector2d a(25, 25);
  HeatNetwork<double>::Vector b = HeatNetwork<double>::Vector::Constant(2, 25.0);
  for (int i = 0; i < 1000; ++i) {
    a = fixed.step(fixed.transition(0.02), a, input_of(3000, 25));
    b = dynamic.step(dynamic.transition(0.02), b, input_of(3000, 25));
  }
  EXPECT_EQ(a[0], b[0]);
  EXPECT_EQ(a[1], b[1]);
}

/// Every law at once, so that each has a slope to be checked.
HeatSet<double> curved_set(double scale) {
  HeatSet<double> set = thermal::two_resistor_set(reference::ec16());
  set.node_count = 3;
  set.nodes[2] = {30.0, thermal::motor_set::no_limit_degC};
  set.link_count = 0;
  auto add = [&](int from, int to, LinkLaw law, double g, double k) {
    set.links[set.link_count++] = {static_cast<std::int8_t>(from), static_cast<std::int8_t>(to), law, g, k};
  };
  add(0, 1, LinkLaw::temperature, 0.9, 0.002 * scale);
  add(1, thermal::boundary_end(Boundary::ambient), LinkLaw::radiation, 0.02 * scale, 0);
  add(1, thermal::boundary_end(Boundary::ambient), LinkLaw::natural_convection, 0.03, 0.25 * scale);
  add(1, thermal::boundary_end(Boundary::ambient), LinkLaw::speed, 0.02, 0.01 * scale);
  add(1, 2, LinkLaw::constant, 0.1, 0);
  add(2, thermal::boundary_end(Boundary::frame), LinkLaw::constant, 0.05 * scale, 0);
  set.sources[2] = {1, Drive::speed2_rad2_per_s2, 1e-5 * scale, 0};
  set.source_count = 3;
  return set;
}

HeatInput<> curved_input() {
  HeatInput<> input = input_of(16, 25);
  input[Drive::speed2_rad2_per_s2] = 90000;
  input[Drive::speed_to_0_8] = std::pow(300, 0.8);
  input[Boundary::frame] = 30;
  return input;
}

TEST(Network, CurvedLawsAgreeWithTheReference) {
  const HeatNetwork<double, 3> net(curved_set(1));
  const auto step = net.transition(0.01);
  Eigen::Vector3d T(25, 25, 25);
  std::array<reference::Real, 3> truth{25, 25, 25};
  const auto m = reference::ec16();
  for (int i = 0; i < 6000; ++i) {
    T = net.step(step, T, curved_input());
    reference::rk4(truth, 0.01L, [&](const std::array<reference::Real, 3>& x) {
      using R = reference::Real;
      auto K4 = [](R t) { return powl(t + 273.15L, 4); };
      const R heat = 1.5L * m.phase_resistance_ohm * 16 * (1 + 0.00393L * (x[0] - 25));
      const R across = 0.9L / (1 + 0.002L * (x[0] - 40)) * (x[0] - x[1]);
      const R d = x[1] - 25;
      const R away = 0.02L * (K4(x[1]) - K4(25)) / (4 * 2.7e7L) + 0.03L * powl(sqrtl(d * d + 0.01L) / 20, 0.25L) * d +
                     0.02L * (1 + 0.01L * powl(300, 0.8L)) * d;
      const R on = 0.1L * (x[1] - x[2]);
      return std::array<R, 3>{(heat - across) / static_cast<R>(m.C1_J_per_K),
                              (across + 0.9L - away - on) / static_cast<R>(m.C2_J_per_K),
                              (on - 0.05L * (x[2] - 30)) / 30};
    });
  }
  for (int k = 0; k < 3; ++k) EXPECT_NEAR(T[k], static_cast<double>(truth[static_cast<std::size_t>(k)]), 1e-4);
  EXPECT_GT(T[1], 50.0);
}

TEST(Network, DualNumbersGiveTheSlopeOfTheVerySameCode) {
  auto end_degC = [](const HeatSet<double>& set) {
    const HeatNetwork<double, 3> net(set);
    const auto step = net.transition(0.5);
    Eigen::Vector3d T(25, 25, 25);
    for (int i = 0; i < 200; ++i) T = net.step(step, T, curved_input());
    return T;
  };
  HeatSet<double> plain = curved_set(1);
  for (int parameter = 0; parameter < 7; ++parameter) {
    auto seed = [&](auto& set, auto delta) {
      using S = decltype(delta);
      switch (parameter) {
        case 0:
          set.nodes[0].capacity_J_per_K += delta;
          break;
        case 1:
          set.links[0].conductance_W_per_K += delta;
          break;
        case 2:
          set.links[0].k += delta * S(0.01);
          break;
        case 3:
          set.links[1].conductance_W_per_K += delta;
          break;
        case 4:
          set.links[2].k += delta;
          break;
        case 5:
          set.links[3].k += delta * S(0.1);
          break;
        case 6:
          set.sources[0].gain += delta;
          break;
      }
    };
    auto dual_set = convert<Dual>(plain);
    seed(dual_set, Dual(0, 1));
    const HeatNetwork<Dual, 3> net(dual_set);
    const auto step = net.transition(0.5);
    Eigen::Matrix<Dual, 3, 1> T(25, 25, 25);
    for (int i = 0; i < 200; ++i) T = net.step(step, T, curved_input());
    const double h = 1e-5;
    HeatSet<double> up = plain, down = plain;
    seed(up, h);
    seed(down, -h);
    const Eigen::Vector3d slope = (end_degC(up) - end_degC(down)) / (2 * h);
    for (int k = 0; k < 3; ++k) {
      EXPECT_NEAR(T[k].d, slope[k], 1e-5 * (1 + slope.norm())) << "parameter " << parameter << " node " << k;
      EXPECT_NEAR(T[k].v, end_degC(plain)[k], 1e-10);
    }
    EXPECT_GT(slope.norm(), 0.1) << "parameter " << parameter << " has no effect: the check is empty";
  }
}

TEST(Validate, NamesTheFirstProblem) {
  const HeatSet<double> good = curved_set(1);
  ASSERT_TRUE(thermal::validate(good, 0.01).ok());
  const double nan = std::nan("");
  auto expect = [&](SetProblem problem, int index, auto spoil) {
    HeatSet<double> set = good;
    spoil(set);
    const auto check = thermal::validate(set, 0.01);
    EXPECT_EQ(static_cast<int>(check.problem), static_cast<int>(problem));
    EXPECT_EQ(check.index, index);
  };
  expect(SetProblem::bad_count, 0, [](auto& s) { s.node_count = 9; });
  expect(SetProblem::bad_count, 1, [](auto& s) { s.link_count = -1; });
  expect(SetProblem::bad_capacity, 1, [](auto& s) { s.nodes[1].capacity_J_per_K = -1; });
  expect(SetProblem::bad_capacity, 0, [&](auto& s) { s.nodes[0].capacity_J_per_K = nan; });
  expect(SetProblem::bad_limit, 0, [](auto& s) { s.nodes[0].max_degC = std::nanf(""); });
  expect(SetProblem::bad_link_end, 2, [](auto& s) { s.links[2].to = 12; });
  expect(SetProblem::bad_link_end, 2, [](auto& s) { s.links[2].to = s.links[2].from; });
  expect(SetProblem::bad_conductance, 4, [](auto& s) { s.links[4].conductance_W_per_K = -0.1; });
  expect(SetProblem::bad_conductance, 4, [&](auto& s) { s.links[4].conductance_W_per_K = nan; });
  expect(SetProblem::bad_law, 3, [](auto& s) { s.links[3].law = LinkLaw::count; });
  expect(SetProblem::bad_source, 1, [](auto& s) { s.sources[1].node = 3; });
  expect(SetProblem::bad_source, 0, [&](auto& s) { s.sources[0].gain = nan; });
  expect(SetProblem::bad_source, 0, [](auto& s) { s.sources[0].gain = -0.5; });
  expect(SetProblem::bad_source, 1, [](auto& s) { s.sources[1].coefficient_per_K = -0.01; });
  expect(SetProblem::bad_sensor, 0, [](auto& s) { s.housing.lag_s = -1; });
  expect(SetProblem::unconnected_node, 2, [](auto& s) {
    s.links[4].conductance_W_per_K = 0;
    s.links[5].conductance_W_per_K = 0;
  });
  expect(SetProblem::unconnected_node, 0, [](auto& s) { s.link_count = 0; });
  expect(SetProblem::time_constant_too_short, 0, [](auto& s) { s.nodes[0].capacity_J_per_K = 1e-9; });
}

}  // namespace
