/** @file
 *  oracle_run MODEL.txt SIGNALS.csv
 *  The whole chain once more, sender to verdict, every frame delivered: prints k,plant,bus,r...,J... a sample.
 *  MODEL.txt holds blocks `name rows cols` and rows lines of numbers; SIGNALS.csv a header row and one row of readings a sample. */
#include "oracle.hpp"

#include <cstdio>
#include <deque>
#include <fstream>
#include <iostream>
#include <map>
#include <sstream>
#include <stdexcept>
#include <string>

namespace {

using oracle::Matrix;
using oracle::Vector;
using std::size_t;

class Model {
public:
    explicit Model(const std::string &path)
    {
        std::ifstream file(path);
        if (!file) { throw std::runtime_error("cannot read " + path); }
        std::string name;
        Eigen::Index rows = 0, cols = 0;
        while (file >> name >> rows >> cols) {
            Matrix m(rows, cols);
            for (Eigen::Index i = 0; i < rows * cols; ++i) {
                std::string number;
                if (!(file >> number)) { throw std::runtime_error("block " + name + " is too short"); }
                m(i / cols, i % cols) = std::stod(number);
            }
            blocks_[name] = m;
        }
        if (!file.eof()) { throw std::runtime_error("after block " + name + ": not a block `name rows cols`"); }
    }

    const Matrix &matrix(const std::string &name) const
    {
        const auto found = blocks_.find(name);
        if (found == blocks_.end()) { throw std::runtime_error("the model has no block " + name); }
        return found->second;
    }
    double number(const std::string &name) const
    {
        if (matrix(name).size() != 1) { throw std::runtime_error("block " + name + " is not one number"); }
        return matrix(name)(0, 0);
    }
    int                 whole(const std::string &name) const { return static_cast<int>(number(name)); }
    std::vector<double> row(const std::string &name) const
    {
        const Matrix &m = matrix(name);
        return std::vector<double>(m.data(), m.data() + m.size()); /* one row or one column: the order is the same */
    }
    std::vector<size_t> places(const std::string &name) const
    {
        std::vector<size_t> out;
        for (double x : row(name)) { out.push_back(static_cast<size_t>(x)); }
        return out;
    }
    oracle::Table table(const std::string &name) const
    {
        const Matrix &m = matrix(name);
        oracle::Table out(static_cast<size_t>(m.rows()));
        for (Eigen::Index i = 0; i < m.rows(); ++i) {
            for (Eigen::Index j = 0; j < m.cols(); ++j) { out[static_cast<size_t>(i)].push_back(m(i, j)); }
        }
        return out;
    }

private:
    std::map<std::string, Matrix> blocks_;
};

/* One sender and its receiver. */
struct Group {
    size_t           first, width;
    oracle::Receiver receiver;
    oracle::Sender   sender;
    oracle::Hold     hold;

    Group(const Model &m, const std::string &name)
        : first(static_cast<size_t>(m.whole(name + ".first"))), width(static_cast<size_t>(m.whole(name + ".width"))), receiver(read(m, name)),
          sender(receiver.trigger), hold(receiver)
    {
    }
    Group(const Group &) = delete;
    Group &operator=(const Group &) = delete;
    void step(const std::vector<double> &reading, Vector &value, Vector &radius);

private:
    static oracle::Receiver read(const Model &m, const std::string &name);
};

oracle::Receiver Group::read(const Model &m, const std::string &name)
{
    oracle::Receiver r;
    r.trigger.interval_max = m.whole(name + ".interval_max");
    for (double h : m.row(name + ".silence")) { r.trigger.silence.push_back(static_cast<int>(h)); }
    r.trigger.delta    = m.table(name + ".delta");
    r.trigger.sigma    = m.table(name + ".sigma");
    r.trigger.activity = m.table(name + ".activity");
    r.trigger.zero     = m.row(name + ".zero");
    r.margin           = m.whole(name + ".margin");
    const std::vector<double> resolution = m.row(name + ".resolution"), offset = m.row(name + ".offset");
    const std::vector<double> minimum = m.row(name + ".minimum"), maximum = m.row(name + ".maximum");
    for (size_t g = 0; g < resolution.size(); ++g) { r.scale.push_back({resolution.at(g), offset.at(g), minimum.at(g), maximum.at(g)}); }
    r.half   = m.row(name + ".half");
    r.span   = m.row(name + ".span");
    r.middle = m.row(name + ".middle");
    r.slew   = m.table(name + ".slew");
    const size_t width = static_cast<size_t>(m.whole(name + ".width"));
    for (size_t found : {r.trigger.zero.size(), r.scale.size(), r.half.size(), r.span.size(), r.middle.size()}) {
        if (found != width) { throw std::runtime_error(name + ": a list is not as long as its width"); }
    }
    if (static_cast<int>(r.slew.size()) < r.trigger.interval_max + r.margin) { throw std::runtime_error(name + ".slew is too short"); }
    return r;
}

void Group::step(const std::vector<double> &reading, Vector &value, Vector &radius)
{
    oracle::Codes code;
    for (size_t g = 0; g < width; ++g) { code.push_back(oracle::encode(receiver.scale[g], reading.at(first + g))); }
    if (sender.step(code)) { hold.receive({code, true}); }
    hold.step();
    for (size_t g = 0; g < width; ++g) {
        value(static_cast<Eigen::Index>(first + g))  = hold.value()[g];
        radius(static_cast<Eigen::Index>(first + g)) = hold.radii().back()[g];
    }
}

/* One residual generator with its threshold. */
struct Detector {
    oracle::Generator   generator;
    oracle::Plant       plant;
    std::vector<size_t> y, u; /* places in the signal vector */
    oracle::Cascade     cascade;
    oracle::Hull        hull;
    std::vector<Vector> y_radius, u_radius;
    int                 ready;
    Vector              r, J;

    Detector(const Model &m, const std::string &name, bool rest)
        : generator{m.matrix(name + ".G"), m.matrix(name + ".H"), m.matrix(name + ".L"), m.matrix(name + ".W"), m.matrix(name + ".V"),
                    m.matrix(name + ".Qu"), m.matrix(name + ".Lo"), m.matrix(name + ".Mo")},
          plant{m.matrix(name + ".A"), m.matrix(name + ".B"), m.matrix(name + ".C"), m.matrix(name + ".D"), m.matrix(name + ".Ed"), m.matrix(name + ".Fd")},
          cascade(generator), hull(generator, plant, m.matrix(name + (rest ? ".initial" : ".range"))),
          ready(m.whole(name + (rest ? ".ready_rest" : ".ready_moving")))
    {
        const std::vector<size_t> outputs = m.places("outputs"), inputs = m.places("inputs");
        for (size_t i : m.places(name + ".outputs")) { y.push_back(outputs.at(i)); }
        for (size_t i : m.places(name + ".inputs")) { u.push_back(inputs.at(i)); }
    }
    Detector(const Detector &) = delete;
    Detector &operator=(const Detector &) = delete;

    static Vector pick(const Vector &all, const std::vector<size_t> &places)
    {
        Vector out(static_cast<Eigen::Index>(places.size()));
        for (size_t i = 0; i < places.size(); ++i) { out(static_cast<Eigen::Index>(i)) = all(static_cast<Eigen::Index>(places[i])); }
        return out;
    }
    bool step(const Vector &value, const Vector &radius)
    {
        y_radius.push_back(pick(radius, y));
        u_radius.push_back(pick(radius, u));
        r = cascade.step(pick(value, y), pick(value, u));
        J = hull.threshold(y_radius, u_radius);
        return (r.cwiseAbs().array() > J.array()).any();
    }
    bool settled() const { return static_cast<int>(y_radius.size()) >= ready; }
};

std::vector<double> numbers(const std::string &line)
{
    std::vector<double> out;
    std::stringstream   cells(line);
    std::string         cell;
    while (std::getline(cells, cell, ',')) { out.push_back(std::stod(cell)); }
    return out;
}

class Run {
public:
    explicit Run(const Model &m)
    {
        const bool rest = m.number("start") != 0.0;
        const int  groups = m.whole("groups"), generators = m.whole("generators");
        for (int i = 0; i < groups; ++i) {
            groups_.emplace_back(m, "group" + std::to_string(i));
            width_ = std::max(width_, groups_.back().first + groups_.back().width);
        }
        for (int i = 0; i < generators; ++i) {
            const std::string name = "gen" + std::to_string(i);
            detectors_.emplace_back(m, name, rest);
            rules_.feeds.push_back(static_cast<unsigned>(m.whole(name + ".feeds")));
            rules_.faults.push_back(0); /* candidates are not printed */
        }
        rules_.up    = m.whole("decision.up");
        rules_.down  = m.whole("decision.down");
        rules_.latch = m.number("decision.latch") != 0.0;
    }

    void samples(std::istream &signals)
    {
        oracle::Decision decision(rules_);
        std::string      line;
        std::getline(signals, line); /* names */
        for (long k = 0; std::getline(signals, line); ++k) {
            if (line.find_first_not_of(" \r\t") == std::string::npos) { break; }
            sample(k, numbers(line), decision);
        }
    }

private:
    void sample(long k, const std::vector<double> &reading, oracle::Decision &decision)
    {
        Vector           value = Vector::Zero(static_cast<Eigen::Index>(width_)), radius = value;
        oracle::Evidence evidence;
        unsigned         bus = 0;
        for (size_t i = 0; i < groups_.size(); ++i) {
            groups_[i].step(reading, value, radius);
            bus |= static_cast<unsigned>(groups_[i].hold.health()) << (2 * i);
            evidence.doubt |= static_cast<unsigned>(groups_[i].hold.doubt()) << i;
        }
        std::string r, J;
        for (Detector &d : detectors_) {
            evidence.alarm.push_back(d.step(value, radius));
            evidence.ready = evidence.ready && d.settled();
            r += text(d.r);
            J += text(d.J);
        }
        std::printf("%ld,%d,%u%s%s\n", k, static_cast<int>(decision.step(evidence)), bus, r.c_str(), J.c_str());
    }
    static std::string text(const Vector &v)
    {
        std::string out;
        for (Eigen::Index i = 0; i < v.size(); ++i) {
            char cell[40];
            std::snprintf(cell, sizeof cell, ",%.17g", v(i));
            out += cell;
        }
        return out;
    }

    std::deque<Group>    groups_; /* deques: what they hold refers to itself and must not move */
    std::deque<Detector> detectors_;
    oracle::Rules        rules_;
    size_t               width_ = 0;
};

} // namespace

int main(int argc, char **argv)
{
    if (argc != 3) {
        std::fprintf(stderr, "usage: oracle_run MODEL.txt SIGNALS.csv\n");
        return 2;
    }
    try {
        const Model   model(argv[1]);
        std::ifstream signals(argv[2]);
        if (!signals) { throw std::runtime_error(std::string("cannot read ") + argv[2]); }
        Run(model).samples(signals);
    } catch (const std::exception &error) {
        std::fprintf(stderr, "oracle_run: %s\n", error.what());
        return 2;
    }
    return 0;
}
