// What networks say of sampled people, through two simple ones: colours of pixels as the embedding,
// mean colours as the features. Against loops, and against what copies and shuffled samples must
// give.
#include "toolchain/generation/networks.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <atomic>
#include <cmath>
#include <map>
#include <nlohmann/json.hpp>
#include <numeric>

#include "runtime/test_packages.h"
#include "toolchain/error.h"

namespace figurine::generation::networks_test {

using features::ComparingNetworks;
using features::FeatureNetwork;
using features::over_grey;
using features::PerceptualNetwork;
using features::RgbPictures;
using features::RgbView;
using measure::BootstrapOptions;
using measure::Picture;
using measure::RowMatrix;

namespace {

constexpr uint32_t kSide_px = 6;
constexpr size_t kPictures = 3;
constexpr BootstrapOptions kBootstrap{.replicates = 20, .seed = 1};

class Pixels : public PerceptualNetwork {
 public:
  const std::string& name() const override { return name_; }
  nlohmann::json describe() const override { return {{"name", name_}}; }
  size_t seen() const { return seen_; }

 private:
  std::vector<float> embedding_of(const RgbView& picture) const override {
    ++seen_;
    return {picture.values.begin(), picture.values.end()};
  }
  std::string name_ = "pixels";
  mutable std::atomic<size_t> seen_{0};
};

// Means of colours, each as often as asked for: `dimension` = 3 times that.
class Colours : public FeatureNetwork {
 public:
  explicit Colours(size_t dimension) : dimension_(dimension) {}
  const std::string& name() const override { return name_; }
  nlohmann::json describe() const override { return {{"name", name_}}; }
  size_t dimension() const override { return dimension_; }

 private:
  void features_of(const RgbView& picture, std::span<double> features) const override {
    const size_t pixels = picture.values.size() / 3;
    for (size_t f = 0; f < features.size(); ++f) {
      const auto plane = picture.values.subspan(f % 3 * pixels, pixels);
      features[f] = std::accumulate(plane.begin(), plane.end(), 0.0) / double(pixels);
    }
  }
  std::string name_ = "colours";
  size_t dimension_;
};

People random_people(size_t count, uint64_t seed) {
  tests::Random random(seed);
  People people(count);
  for (std::vector<Picture>& pictures : people) {
    pictures.resize(kPictures);
    for (Picture& picture : pictures) {
      picture = {kSide_px, kSide_px, {}};
      const float shade = random.uniform(0, 200);
      for (size_t i = 0; i < size_t{kSide_px} * kSide_px; ++i) {
        for (int c = 0; c < 3; ++c)
          picture.rgba.push_back(static_cast<uint8_t>(shade + random.uniform(0, 50)));
        picture.rgba.push_back(255);
      }
    }
  }
  return people;
}

double loop_distance(const std::vector<Picture>& a, const std::vector<Picture>& b) {
  double sum = 0;
  for (size_t v = 0; v < kPictures; ++v) {
    const RgbPictures x = over_grey({&a[v], 1}), y = over_grey({&b[v], 1});
    for (size_t i = 0; i < x.values.size(); ++i)
      sum += std::pow(double(x.values[i]) - double(y.values[i]), 2);
  }
  return sum / double(kPictures);
}

std::shared_ptr<const Pixels> pixels() { return std::make_shared<const Pixels>(); }

ComparingNetworks both(size_t dimension = 3) {
  return {{std::make_shared<const Colours>(dimension)}, {pixels()}};
}

double value(const nlohmann::json& of) { return of.at("value").get<double>(); }

TEST(PeopleDistances, AreMeansOverPicturesOfTheSameShot) {
  const People people = random_people(19, 1),
               references = random_people(5, 2);  // more than a tile's
  const auto network = pixels();
  const PeopleDistances found = measure_distances(*network, people, references, 2);
  EXPECT_EQ(network->seen(), (19 + 5) * kPictures) << "a picture is looked at once";
  double worst = 0;
  for (size_t i = 0; i < people.size(); ++i) {
    for (size_t j = 0; j < references.size(); ++j) {
      const double expected = loop_distance(people[i], references[j]);
      worst = std::max(
          worst, std::abs(found.to_references(Eigen::Index(i), Eigen::Index(j)) / expected - 1));
    }
    for (size_t j = 0; j < people.size(); ++j) {
      const double own = found.within(Eigen::Index(i), Eigen::Index(j)),
                   expected = loop_distance(people[i], people[j]);
      EXPECT_EQ(own, found.within(Eigen::Index(j), Eigen::Index(i)));
      if (i == j) {
        EXPECT_EQ(own, 0);
      } else {
        worst = std::max(worst, std::abs(own / expected - 1));
      }
    }
  }
  std::printf("  largest relative error %.1e\n", worst);
  EXPECT_LT(worst, 1e-12);
  const PeopleDistances alone = measure_distances(*network, people, {}, 1);
  EXPECT_EQ(alone.within, found.within) << "in any company, on any number of threads";
  EXPECT_EQ(alone.to_references.cols(), 0);
}

TEST(PeopleFeatures, StandPersonByPerson) {
  const People people = random_people(4, 3);
  const Colours network(3);
  const RowMatrix features = measure_features(network, people, 2);
  ASSERT_EQ(features.rows(), Eigen::Index(4 * kPictures));
  for (size_t i = 0; i < 4; ++i) {
    EXPECT_EQ(features.middleRows(Eigen::Index(i * kPictures), Eigen::Index(kPictures)),
              network.features(over_grey(people[i])));
  }
}

TEST(GenerationNetworks, CopiesAreFoundOut) {
  const People training = random_people(8, 4), held_out = random_people(5, 5);
  const ComparingNetworks networks = both();
  const GenerationNetworks judge(networks, training, held_out, 2, kBootstrap);
  nlohmann::json row;
  judge.add_samples(training, Eigen::Index(training.size()), row);
  const nlohmann::json& near = row.at("train").at("perceptual").at("pixels");
  EXPECT_EQ(value(near.at("mmd")), 0);
  EXPECT_EQ(value(near.at("coverage_percent")), 100);
  EXPECT_EQ(value(near.at("one_nna_percent")), 0);
  EXPECT_EQ(near.at("one_nna_off_ideal"), 50);
  EXPECT_NEAR(value(row.at("train").at("frechet").at("colours")), 0, 1e-12);
  // Of equal sets the estimate is below 0, by the kernel of everybody with themselves: 2 (mean of
  // all other pairs - mean of all pairs).
  EXPECT_LT(value(row.at("train").at("kid").at("colours")), 0);
  const nlohmann::json& novelty = row.at("novelty").at("perceptual").at("pixels");
  EXPECT_EQ(novelty.at("copy_share"), 1);
  EXPECT_EQ(novelty.at("median_ratio"), 0);
  EXPECT_EQ(novelty.at("members_met"), 8);
  EXPECT_GT(value(row.at("held_out").at("perceptual").at("pixels").at("mmd")), 0);
  EXPECT_GT(value(row.at("held_out").at("frechet").at("colours")), 1e-6);
  EXPECT_LE(row.at("held_out").at("perceptual").at("pixels").at("mmd").at("low"),
            row.at("held_out").at("perceptual").at("pixels").at("mmd").at("high"));

  nlohmann::json members, strangers;
  judge.add_training_as_samples(members);
  EXPECT_EQ(members.at("held_out"), row.at("held_out")) << "the same people by another way";
  EXPECT_FALSE(members.contains("train"));
  judge.add_held_out_novelty(strangers);
  EXPECT_LT(strangers.at("novelty").at("perceptual").at("pixels").at("copy_share"), 0.5);
}

// A sampler that learnt from the first four of them is not to be blamed for being like the others.
TEST(GenerationNetworks, TheAuditLooksForWhomASamplerLearntFrom) {
  const People training = random_people(8, 4), held_out = random_people(5, 5);
  const ComparingNetworks networks = both();
  const GenerationNetworks judge(networks, training, held_out, 2, kBootstrap);
  nlohmann::json all, half;
  judge.add_samples(training, 8, all), judge.add_samples(training, 4, half);
  const auto audit = [](const nlohmann::json& row) {
    return row.at("novelty").at("perceptual").at("pixels");
  };
  EXPECT_EQ(audit(all).at("copy_share"), 1);
  EXPECT_EQ(audit(all).at("members_met"), 8);
  EXPECT_GE(audit(half).at("copy_share"), 0.5);
  EXPECT_LT(audit(half).at("copy_share"), 1) << "the four others are people of their own";
  EXPECT_EQ(audit(half).at("members_met"), 4);
  EXPECT_EQ(half.at("train"), all.at("train"));
}

TEST(GenerationNetworks, TheOrderOfSamplesDoesNotMatter) {
  const People training = random_people(6, 6), held_out = random_people(6, 7),
               samples = random_people(6, 8);
  const ComparingNetworks networks = both();
  const GenerationNetworks judge(networks, training, held_out, 2, kBootstrap);
  nlohmann::json row, other_row;
  judge.add_samples(samples, Eigen::Index(training.size()), row);
  judge.add_samples({samples[4], samples[0], samples[5], samples[2], samples[1], samples[3]},
                    Eigen::Index(training.size()), other_row);
  for (const char* part : {"held_out", "train"}) {
    for (const char* key : {"mmd", "coverage_percent", "one_nna_percent"}) {
      EXPECT_NEAR(value(row.at(part).at("perceptual").at("pixels").at(key)),
                  value(other_row.at(part).at("perceptual").at("pixels").at(key)), 1e-12)
          << part << ' ' << key;
    }
    for (const char* kind : {"kid", "frechet"}) {
      EXPECT_NEAR(value(row.at(part).at(kind).at("colours")),
                  value(other_row.at(part).at(kind).at("colours")), 1e-12)
          << part << ' ' << kind;
    }
  }
  double expected = 0;  // MMD in loops
  for (const std::vector<Picture>& reference : held_out) {
    double nearest = INFINITY;
    for (const std::vector<Picture>& sample : samples)
      nearest = std::min(nearest, loop_distance(sample, reference));
    expected += nearest / double(held_out.size());
  }
  EXPECT_NEAR(value(row.at("held_out").at("perceptual").at("pixels").at("mmd")), expected,
              1e-12 * expected);
}

// Eight samples are four draws of two held-out people: the interval is the first one's, the means
// are of all.
TEST(GenerationNetworks, MoreSamplesThanHeldOutPeopleAreMoreDraws) {
  const People training = random_people(8, 12), held_out = random_people(2, 13),
               samples = random_people(8, 14);
  const ComparingNetworks networks = both();
  const auto judged = [&](const People& people, const People& references) {
    nlohmann::json row;
    GenerationNetworks(networks, training, references, 1, kBootstrap).add_samples(people, 8, row);
    return row.at("held_out").at("perceptual").at("pixels");
  };
  const nlohmann::json found = judged(samples, held_out), &draws = found.at("draws");
  EXPECT_EQ(found.at("count"), 2);
  EXPECT_EQ(draws.at("count"), 4);
  std::map<std::string, double> sums;
  for (size_t d = 0; d < 4; ++d) {
    People turned = samples;
    std::rotate(turned.begin(), turned.begin() + std::ptrdiff_t(2 * d), turned.end());
    const nlohmann::json one = judged(turned, held_out);
    for (const char* key : {"mmd", "coverage_percent", "one_nna_percent"})
      sums[key] += value(one.at(key)) / 4;
    if (d == 0) {
      EXPECT_EQ(one, found);
    }
  }
  for (const auto& [key, mean] : sums)
    EXPECT_NEAR(draws.at(key).get<double>(), mean, 1e-12 * mean) << key;
  EXPECT_NE(draws.at("mmd"), found.at("mmd").at("value"));
  EXPECT_FALSE(judged(samples, random_people(5, 15)).contains("draws")) << "there is one";
}

TEST(GenerationNetworks, LeaveTheFrechetDistanceOutWherePicturesAreFew) {
  const People training = random_people(8, 9), held_out = random_people(4, 10);
  // 24 training pictures are enough for 6 features, 12 held-out ones are not.
  const ComparingNetworks networks = both(6);
  const GenerationNetworks judge(networks, training, held_out, 2, kBootstrap);
  nlohmann::json row;
  judge.add_samples(training, Eigen::Index(training.size()), row);
  EXPECT_TRUE(row.at("train").at("frechet").at("colours").contains("value"));
  EXPECT_EQ(row.at("held_out").at("frechet").at("colours"),
            nlohmann::json({{"left_out", "12 pictures are too few for 6 features"}}));
  EXPECT_TRUE(row.at("held_out").at("kid").at("colours").at("value").is_number());
}

TEST(GenerationNetworks, SayNothingWhereThereAreNone) {
  const People people = random_people(4, 11);
  const ComparingNetworks none;
  const GenerationNetworks judge(none, people, people, 1, kBootstrap);
  nlohmann::json row = nlohmann::json::object();
  judge.add_samples(people, Eigen::Index(people.size()), row), judge.add_training_as_samples(row),
      judge.add_held_out_novelty(row);
  EXPECT_TRUE(row.empty()) << row;
}

}  // namespace
}  // namespace figurine::generation::networks_test
