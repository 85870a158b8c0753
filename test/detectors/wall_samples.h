#ifndef PLUMBLINE_TEST_DETECTORS_WALL_SAMPLES_H_
#define PLUMBLINE_TEST_DETECTORS_WALL_SAMPLES_H_

#include <plumbline/detectors/axial.h>
#include <plumbline/factors/angle.h>

#include <cmath>
#include <cstdint>
#include <random>
#include <vector>

namespace plumbline {

// Directions of walls and clutter as a building gives them.
class WallSampler {
 public:
  explicit WallSampler(std::uint64_t seed) : engine_(seed) {}

  double Uniform() {
    return (static_cast<double>(engine_() >> 11) + 0.5) / 9007199254740992.0;
  }
  double Gaussian() {
    const double radius = std::sqrt(-2.0 * std::log(Uniform()));
    return radius * std::cos(2.0 * kPi * Uniform());
  }

  // `count` walls of at least 0.5 m, of `mean_length` m beyond that, that
  // spread by `stddev_deg` around `direction_deg`, seen with the noise that
  // their length brings.
  void AddWalls(int count, double direction_deg, double stddev_deg,
                double mean_length, std::vector<AxialSample>* samples) {
    for (int i = 0; i < count; ++i) {
      AxialSample sample = Sample(mean_length);
      sample.angle = DegToRad(direction_deg + stddev_deg * Gaussian()) +
                     sample.stddev * Gaussian();
      samples->push_back(sample);
    }
  }

  void AddClutter(int count, double mean_length,
                  std::vector<AxialSample>* samples) {
    for (int i = 0; i < count; ++i) {
      AxialSample sample = Sample(mean_length);
      sample.angle = kPi * Uniform();
      samples->push_back(sample);
    }
  }

 private:
  AxialSample Sample(double mean_length) {
    AxialSample sample;
    sample.length = 0.5 - mean_length * std::log(Uniform());
    sample.stddev = DegToRad(0.7) / std::pow(sample.length, 1.5);
    return sample;
  }

  std::mt19937_64 engine_;
};

}  // namespace plumbline

#endif  // PLUMBLINE_TEST_DETECTORS_WALL_SAMPLES_H_
