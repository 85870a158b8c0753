#include <plumbline/frontend/bags/bag_source.h>

namespace plumbline {
namespace {

// Lies have no end.
constexpr std::size_t kMostTopics = 4096;

}  // namespace

std::size_t BagSource::AddTopic(const BagTopic& topic) {
  for (std::size_t i = 0; i < topics_.size(); ++i) {
    if (topics_[i].name == topic.name && topics_[i].type == topic.type &&
        topics_[i].encoding == topic.encoding &&
        topics_[i].unreadable == topic.unreadable) {
      return i;
    }
  }
  if (topics_.size() < kMostTopics) {
    topics_.push_back(topic);
  } else if (topics_.size() == kMostTopics) {
    topics_.emplace_back();
    topics_.back().name = "(further topics)";
    topics_.back().unreadable = "the bag has too many topics";
  }
  return topics_.size() - 1;
}

std::string PlainTypeName(const std::string& type) {
  const std::size_t place = type.find("/msg/");
  return place == std::string::npos
             ? type
             : type.substr(0, place) + type.substr(place + 4);
}

}  // namespace plumbline
