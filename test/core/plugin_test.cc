#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <plumbline/core/error.h>
#include <plumbline/core/plugin.h>
#include <sys/stat.h>

#include <cstdlib>
#include <filesystem>
#include <fstream>
#include <string>

namespace plumbline {
namespace {

using ::testing::HasSubstr;

std::string MessageOfLoading(const std::string& path) {
  Registry registry;
  try {
    LoadPlugin(path, &registry);
  } catch (const Error& error) {
    return error.what();
  }
  return "no error";
}

TEST(PluginTest, MissingFile) {
  const std::string message = MessageOfLoading("nowhere/libmine.so");
  EXPECT_THAT(message, HasSubstr("nowhere/libmine.so: cannot load plug-in"));
  EXPECT_THAT(message, HasSubstr("No such file"));
}

TEST(PluginTest, FileThatIsNoSharedObject) {
  std::string name =
      (std::filesystem::temp_directory_path() / "plumblineXXXXXX").string();
  const std::filesystem::path folder = mkdtemp(name.data());
  const std::string path = folder / "libmine.so";
  std::ofstream(path) << "not ELF";
  EXPECT_THAT(MessageOfLoading(path), HasSubstr("cannot load plug-in"));
  // A pipe that nobody writes to.
  ASSERT_EQ(mkfifo((folder / "pipe").c_str(), 0600), 0);
  EXPECT_THAT(MessageOfLoading(folder / "pipe"),
              HasSubstr("it is no regular file"));
  std::filesystem::remove_all(folder);
}

#ifdef PLUMBLINE_TEST_PLUGIN_DIR
TEST(PluginTest, RegistersWhatItHas) {
  Registry registry;
  const std::string path = std::string(PLUMBLINE_TEST_PLUGIN_DIR) + "/good.so";
  LoadPlugin(path, &registry);
  EXPECT_EQ(registry.GetFeature("tree").g2o_tag, "MINE_TREE");
  // What it registers is refused like anybody's: the name is taken now.
  EXPECT_THROW(LoadPlugin(path, &registry), Error);
}

TEST(PluginTest, OtherInterfaceVersionIsRefusedWithBothVersions) {
  const std::string message =
      MessageOfLoading(std::string(PLUMBLINE_TEST_PLUGIN_DIR) + "/old.so");
  EXPECT_THAT(message, HasSubstr("interface version 12345"));
  EXPECT_THAT(message, HasSubstr("expected version " +
                                 std::to_string(kPluginInterfaceVersion)));
}
#endif

TEST(PluginTest, SharedObjectThatIsNoPlugin) {
  // The C library's mathematics: always there, never a plug-in.
  EXPECT_THAT(MessageOfLoading("libm.so.6"), HasSubstr("is not a plug-in"));
}

}  // namespace
}  // namespace plumbline
