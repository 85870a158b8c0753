#include <fcntl.h>
#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <plumbline/core/atomic_file.h>
#include <plumbline/core/error.h>
#include <sys/stat.h>
#include <sys/wait.h>
#include <unistd.h>

#include <cerrno>
#include <csignal>
#include <cstdlib>
#include <filesystem>
#include <fstream>
#include <sstream>
#include <stdexcept>
#include <string>

namespace plumbline {
namespace {

namespace fs = std::filesystem;

class AtomicFileTest : public ::testing::Test {
 protected:
  AtomicFileTest() {
    std::string name = (fs::temp_directory_path() / "plumblineXXXXXX").string();
    folder_ = mkdtemp(name.data());
  }
  ~AtomicFileTest() override { fs::remove_all(folder_); }

  static std::string Read(const fs::path& path) {
    std::ifstream stream(path, std::ios::binary);
    std::ostringstream content;
    content << stream.rdbuf();
    return content.str();
  }

  int FilesInFolder() const {
    int count = 0;
    for (const auto& entry : fs::directory_iterator(folder_)) {
      (void)entry;
      ++count;
    }
    return count;
  }

  fs::path folder_;
};

TEST_F(AtomicFileTest, WritesAndReplaces) {
  const std::string path = folder_ / "map.txt";
  WriteFileAtomically(path, [](std::ostream& out) { out << "one\n"; });
  EXPECT_EQ(Read(path), "one\n");
  WriteFileAtomically(path, [](std::ostream& out) { out << "two\r\n"; });
  EXPECT_EQ(Read(path), "two\r\n");
  EXPECT_EQ(FilesInFolder(), 1);
}

TEST_F(AtomicFileTest, EmptyContentIsAFile) {
  WriteFileAtomically(folder_ / "empty", [](std::ostream&) {});
  EXPECT_TRUE(fs::exists(folder_ / "empty"));
  EXPECT_EQ(fs::file_size(folder_ / "empty"), 0u);
}

TEST_F(AtomicFileTest, AnExceptionLeavesTheOldFile) {
  const std::string path = folder_ / "map.txt";
  WriteFileAtomically(path, [](std::ostream& out) { out << "old"; });
  EXPECT_THROW(WriteFileAtomically(path,
                                   [](std::ostream& out) {
                                     out << "half";
                                     throw std::out_of_range("writer");
                                   }),
               std::out_of_range);
  EXPECT_EQ(Read(path), "old");
  EXPECT_EQ(FilesInFolder(), 1);
}

TEST_F(AtomicFileTest, AFailedStreamLeavesTheOldFile) {
  const std::string path = folder_ / "map.txt";
  WriteFileAtomically(path, [](std::ostream& out) { out << "old"; });
  EXPECT_THROW(WriteFileAtomically(path,
                                   [](std::ostream& out) {
                                     out << "half";
                                     out.setstate(std::ios::badbit);
                                   }),
               Error);
  EXPECT_EQ(Read(path), "old");
  EXPECT_EQ(FilesInFolder(), 1);
}

TEST_F(AtomicFileTest, MissingFolderIsNamed) {
  const std::string path = folder_ / "nowhere" / "map.txt";
  try {
    WriteFileAtomically(path, [](std::ostream& out) { out << "x"; });
    ADD_FAILURE();
  } catch (const Error& error) {
    EXPECT_THAT(error.what(), ::testing::HasSubstr(path));
    EXPECT_THAT(error.what(), ::testing::HasSubstr("No such file"));
  }
}

TEST_F(AtomicFileTest, AFolderIsRefused) {
  EXPECT_THROW(WriteFileAtomically(folder_, [](std::ostream&) {}), Error);
  EXPECT_TRUE(fs::is_directory(folder_));
}

TEST_F(AtomicFileTest, ASymbolicLinkStaysALink) {
  WriteFileAtomically(folder_ / "real", [](std::ostream& out) { out << "a"; });
  fs::create_symlink(folder_ / "real", folder_ / "link");
  WriteFileAtomically(folder_ / "link", [](std::ostream& out) { out << "b"; });
  EXPECT_TRUE(fs::is_symlink(folder_ / "link"));
  EXPECT_EQ(Read(folder_ / "real"), "b");
}

TEST_F(AtomicFileTest, DevicesAreWrittenTo) {
  WriteFileAtomically("/dev/null", [](std::ostream& out) { out << "x"; });
  EXPECT_FALSE(fs::is_regular_file("/dev/null"));
}

TEST_F(AtomicFileTest, AFullDeviceIsAnError) {
  if (!fs::exists("/dev/full")) GTEST_SKIP() << "no /dev/full here";
  EXPECT_THROW(
      WriteFileAtomically("/dev/full", [](std::ostream& out) { out << "x"; }),
      Error);
}

// Whether the failure comes when the file is flushed or long before.
TEST_F(AtomicFileTest, AFullDeviceSaysWhy) {
  if (!fs::exists("/dev/full")) GTEST_SKIP() << "no /dev/full here";
  for (const std::size_t size : {std::size_t{1}, std::size_t{10000000}}) {
    try {
      WriteFileAtomically("/dev/full", [size](std::ostream& out) {
        out << std::string(size, 'x');
        errno = 0;
      });
      ADD_FAILURE() << size;
    } catch (const Error& error) {
      EXPECT_THAT(error.what(), ::testing::HasSubstr("No space left")) << size;
    }
  }
}

TEST_F(AtomicFileTest, APipeWithoutAReaderIsRefused) {
  const std::string path = folder_ / "pipe";
  ASSERT_EQ(mkfifo(path.c_str(), 0600), 0);
  try {
    WriteFileAtomically(path, [](std::ostream& out) { out << "x"; });
    ADD_FAILURE();
  } catch (const Error& error) {
    EXPECT_THAT(error.what(), ::testing::HasSubstr("nobody reads"));
  }
  const int reader = open(path.c_str(), O_RDONLY | O_NONBLOCK);
  ASSERT_GE(reader, 0);
  WriteFileAtomically(path, [](std::ostream& out) { out << "xyz"; });
  char text[8];
  EXPECT_EQ(read(reader, text, sizeof(text)), 3);
  close(reader);
  EXPECT_EQ(FilesInFolder(), 1);
}

// Also after kill -9 in the middle of a large file.
TEST_F(AtomicFileTest, AProcessThatIsKilledLeavesTheOldFileAlone) {
  const int probe = open(folder_.c_str(), O_TMPFILE | O_WRONLY, 0600);
  if (probe < 0) GTEST_SKIP() << "no files without names here";
  close(probe);
  const std::string path = folder_ / "map.txt";
  WriteFileAtomically(path, [](std::ostream& out) { out << "old"; });
  const pid_t child = fork();
  ASSERT_GE(child, 0);
  if (child == 0) {
    WriteFileAtomically(path, [](std::ostream& out) {
      out << std::string(1000000, 'x') << std::flush;
      raise(SIGKILL);
    });
    _exit(0);
  }
  int status = 0;
  ASSERT_EQ(waitpid(child, &status, 0), child);
  EXPECT_TRUE(WIFSIGNALED(status));
  EXPECT_EQ(Read(path), "old");
  EXPECT_EQ(FilesInFolder(), 1);
}

// The file is named beside its target, wherever the process stands.
TEST_F(AtomicFileTest, NamesWithoutAFolder) {
  const fs::path before = fs::current_path();
  fs::current_path(folder_);
  WriteFileAtomically("map.txt", [](std::ostream& out) { out << "here"; });
  fs::current_path(before);
  EXPECT_EQ(Read(folder_ / "map.txt"), "here");
  EXPECT_EQ(FilesInFolder(), 1);
}

TEST_F(AtomicFileTest, PermissionsFollowTheUmask) {
  const mode_t old_mask = umask(022);
  WriteFileAtomically(folder_ / "map.txt", [](std::ostream&) {});
  umask(old_mask);
  struct stat status {};
  ASSERT_EQ(stat((folder_ / "map.txt").c_str(), &status), 0);
  EXPECT_EQ(status.st_mode & 0777u, 0644u);
}

}  // namespace
}  // namespace plumbline
