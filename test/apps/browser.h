#ifndef PLUMBLINE_TEST_APPS_BROWSER_H_
#define PLUMBLINE_TEST_APPS_BROWSER_H_

#include <fcntl.h>
#include <gtest/gtest.h>
#include <poll.h>
#include <signal.h>
#include <sys/wait.h>
#include <unistd.h>

#include <array>
#include <chrono>
#include <filesystem>
#include <nlohmann/json.hpp>
#include <stdexcept>
#include <string>
#include <vector>

namespace plumbline {

/// A headless Chromium, told what to do over its debugging pipe (Chrome
/// DevTools Protocol: messages of JSON that end with a zero byte, to descriptor
/// 3 and from descriptor 4).
class Browser {
 public:
  using Json = nlohmann::json;

  /// Path of Chromium, or empty when it is not installed.
  static std::string Find() {
    for (const char* path : {"/usr/bin/chromium", "/usr/bin/chromium-browser",
                             "/usr/bin/google-chrome"}) {
      if (access(path, X_OK) == 0) return path;
    }
    return "";
  }

  /// Starts it with a new profile in `folder`, which is made.
  explicit Browser(const std::string& folder) {
    std::filesystem::create_directories(folder);
    int to[2], from[2];
    if (pipe2(to, O_CLOEXEC) != 0 || pipe2(from, O_CLOEXEC) != 0) {
      throw std::runtime_error("no pipe");
    }
    process_ = fork();
    if (process_ == 0) {
      // A group of its own, so that its helpers end with it.
      setpgid(0, 0);
      // Out of the way of 3 and 4 first.
      const int in = fcntl(to[0], F_DUPFD, 10);
      const int out = fcntl(from[1], F_DUPFD, 10);
      dup2(in, 3);
      dup2(out, 4);
      const int null = open("/dev/null", O_RDWR);
      for (const int standard : {0, 1, 2}) dup2(null, standard);
      const std::string profile = "--user-data-dir=" + folder;
      execl(Find().c_str(), "chromium", "--headless", "--no-sandbox",
            "--disable-gpu", "--disable-quic", "--no-first-run",
            "--disable-background-networking", "--disable-component-update",
            "--disable-sync", "--remote-debugging-pipe",
            "--force-device-scale-factor=1", "--window-size=1300,1000",
            profile.c_str(), "about:blank", static_cast<char*>(nullptr));
      _exit(127);
    }
    close(to[0]);
    close(from[1]);
    write_ = to[1];
    read_ = from[0];
    signal(SIGPIPE, SIG_IGN);
  }

  ~Browser() {
    close(write_);
    close(read_);
    kill(-process_, SIGKILL);
    waitpid(process_, nullptr, 0);
  }
  Browser(const Browser&) = delete;
  Browser& operator=(const Browser&) = delete;

  /// Opens a page in a tab and waits until it is loaded.
  void Open(const std::string& url) {
    const Json target =
        Call("Target.createTarget", {{"url", "about:blank"}})["targetId"];
    session_ = Call("Target.attachToTarget",
                    {{"targetId", target}, {"flatten", true}})["sessionId"]
                   .get<std::string>();
    for (const char* domain : {"Page", "Runtime", "Log"}) {
      Call(std::string(domain) + ".enable");
    }
    is_loaded_ = false;
    Call("Page.navigate", {{"url", url}});
    while (!is_loaded_) Read();
  }

  /// Value of an expression in the page; a promise is waited for. Throws when
  /// the expression does.
  Json Evaluate(const std::string& expression) {
    const Json result = Call("Runtime.evaluate", {{"expression", expression},
                                                  {"awaitPromise", true},
                                                  {"returnByValue", true}});
    if (result.contains("exceptionDetails")) {
      throw std::runtime_error(expression + ": " +
                               result["exceptionDetails"].dump());
    }
    return result["result"].value("value", Json());
  }

  /// A mouse event ("mouseMoved", "mousePressed", "mouseReleased",
  /// "mouseWheel") at a place of the window, px.
  void Mouse(const std::string& type, double x, double y,
             double wheel_y = 0.0) {
    Json event = {{"type", type}, {"x", x}, {"y", y}};
    if (type == "mousePressed" || type == "mouseReleased") {
      event["button"] = "left";
      event["clickCount"] = 1;
    }
    if (type == "mouseMoved") event["button"] = "none";
    if (type == "mouseWheel") {
      event["deltaX"] = 0.0;
      event["deltaY"] = wheel_y;
    }
    Call("Input.dispatchMouseEvent", event);
    // Once what it leads to is drawn.
    Evaluate(
        "new Promise(done => requestAnimationFrame(() => "
        "requestAnimationFrame(() => done(0))))");
  }

  Json Call(const std::string& method,
            const Json& parameters = Json::object()) {
    const int id = ++last_id_;
    Json message = {{"id", id}, {"method", method}, {"params", parameters}};
    if (!session_.empty() && method.rfind("Target.", 0) != 0) {
      message["sessionId"] = session_;
    }
    const std::string text = message.dump() + '\0';
    std::size_t written = 0;
    while (written < text.size()) {
      const ssize_t count =
          write(write_, text.data() + written, text.size() - written);
      if (count <= 0) throw std::runtime_error("Chromium is gone");
      written += static_cast<std::size_t>(count);
    }
    for (;;) {
      const Json answer = Read();
      if (answer.value("id", 0) != id) continue;
      if (answer.contains("error")) {
        throw std::runtime_error(method + ": " + answer["error"].dump());
      }
      return answer["result"];
    }
  }

  /// Errors and warnings that the page's console showed, and exceptions.
  const std::vector<std::string>& complaints() const { return complaints_; }

 private:
  // The next message; events are taken note of.
  Json Read() {
    const auto deadline =
        std::chrono::steady_clock::now() + std::chrono::seconds(120);
    std::size_t end;
    while ((end = buffer_.find('\0')) == std::string::npos) {
      pollfd descriptor = {read_, POLLIN, 0};
      if (std::chrono::steady_clock::now() > deadline) {
        throw std::runtime_error("Chromium does not answer");
      }
      if (poll(&descriptor, 1, 1000) <= 0) continue;
      std::array<char, 65536> bytes;
      const ssize_t count = read(read_, bytes.data(), bytes.size());
      if (count <= 0) throw std::runtime_error("Chromium is gone");
      buffer_.append(bytes.data(), static_cast<std::size_t>(count));
    }
    const Json message = Json::parse(buffer_.substr(0, end));
    buffer_.erase(0, end + 1);
    const std::string method = message.value("method", "");
    if (method == "Page.loadEventFired") is_loaded_ = true;
    const bool is_console = method == "Runtime.consoleAPICalled" &&
                            (message["params"]["type"] == "error" ||
                             message["params"]["type"] == "warning" ||
                             message["params"]["type"] == "assert");
    if (is_console || method == "Runtime.exceptionThrown" ||
        method == "Log.entryAdded") {
      complaints_.push_back(message["params"].dump());
    }
    return message;
  }

  pid_t process_ = 0;
  int write_ = -1;
  int read_ = -1;
  int last_id_ = 0;
  bool is_loaded_ = false;
  std::string session_;
  std::string buffer_;
  std::vector<std::string> complaints_;
};

}  // namespace plumbline

#endif  // PLUMBLINE_TEST_APPS_BROWSER_H_
