#include "oracle.hpp"

#include <algorithm>
#include <cmath>
#include <cstdlib>

namespace oracle {

using std::size_t;

namespace {

size_t at(long index) { return static_cast<size_t>(index); }

bool any_empty(const Codes &code)
{
    return std::any_of(code.begin(), code.end(), [](const Code &c) { return !c.has_value(); });
}

} // namespace

/* ---- Codes and the trigger ---- */

Code encode(const Scale &scale, double value)
{
    const double code = std::round((value - scale.offset) / scale.resolution); /* a tie goes away from zero */
    if (!std::isfinite(value) || code < scale.minimum || code > scale.maximum) {
        return std::nullopt;
    }
    return code;
}

double decode(const Scale &scale, double code)
{
    return scale.offset + scale.resolution * code;
}

/* platoon, section 4: delta |ybar| + sigma, in codes. delta |..| < 2^48, so the double is exact before the floor. */
double Trigger::threshold(int level, int channel, const Code &sent) const
{
    if (!sent) {
        return 0.0; /* any change is worth a frame */
    }
    const double relative = std::floor(delta[at(level)][at(channel)] * std::abs(*sent - zero[at(channel)]) / 65536.0);
    return std::min(sigma[at(level)][at(channel)] + relative, 2147483647.0);
}

int Trigger::level(const Codes &sent, const Codes &previous) const
{
    if (width() > 0 && (any_empty(sent) || any_empty(previous))) {
        return levels() - 1;
    }
    for (int l = levels() - 1; l > 0; --l) {
        for (size_t g = 0; g < sent.size(); ++g) {
            if (std::abs(*sent[g] - *previous[g]) >= activity[at(l)][g]) {
                return l;
            }
        }
    }
    return 0;
}

/* A value that appears or disappears is a change beyond any threshold: no threshold is a promise about an unknown value. */
static bool deviates(const Code &code, const Code &sent, double threshold)
{
    if (code.has_value() != sent.has_value()) {
        return true;
    }
    return code.has_value() && std::abs(*code - *sent) > threshold;
}

bool Sender::step(const Codes &code)
{
    ++k_;
    const bool first = last_ < 0;
    bool       speak = first || k_ - last_ >= trigger_.interval_max;
    if (!speak && k_ - last_ > trigger_.silence[at(level_)]) {
        for (int g = 0; g < trigger_.width(); ++g) {
            speak = speak || deviates(code[at(g)], sent_[at(g)], trigger_.threshold(level_, g, sent_[at(g)]));
        }
    }
    if (speak) {
        level_ = first ? 0 : trigger_.level(code, sent_);
        sent_  = code;
        last_  = k_;
    }
    return speak;
}

/* ---- The hold ---- */

bool Hold::receive(const Frame &frame)
{
    if (fresh_) {
        return false;
    }
    fresh_ = frame;
    return true;
}

/* Before the first good frame there is nothing to distrust yet. */
void Hold::lose()
{
    if (fresh_) {
        lost_behind_ = true; /* after the frame of this sample, which stays good */
    } else if (sent_) {
        lost_ = true;
    }
}

/* What holds whether or not frames were lost: the slew from the last good frame, the span where that does not reach. */
std::vector<double> Hold::careful(const Codes &sent, long age) const
{
    std::vector<double> radius = receiver_.span;
    for (size_t g = 0; g < radius.size(); ++g) {
        if (sent[g] && age <= receiver_.trigger.interval_max + receiver_.margin) {
            radius[g] = receiver_.slew[at(age - 1)][g];
        }
    }
    return radius;
}

/* What holds if the sender had nothing to say. Before two good frames in a row its level is unknown and the widest one counts. */
std::vector<double> Hold::trusting(long age) const
{
    const Trigger &t     = receiver_.trigger;
    const bool     known = in_row_ >= 2;
    const int      from  = known ? t.level(*sent_, previous_) : 0;
    const int      to    = known ? from : t.levels() - 1;

    std::vector<double> radius = careful(*sent_, age);
    if (age <= *std::max_element(t.silence.begin() + from, t.silence.begin() + to + 1)) {
        return radius; /* the sender does not look yet */
    }
    for (int g = 0; g < t.width(); ++g) {
        double threshold = 0.0;
        for (int l = from; l <= to; ++l) {
            threshold = std::max(threshold, t.threshold(l, g, (*sent_)[at(g)]));
        }
        if ((*sent_)[at(g)]) {
            radius[at(g)] = std::min(radius[at(g)], threshold * receiver_.scale[at(g)].resolution + receiver_.half[at(g)]);
        }
    }
    return radius;
}

/* A gap spoils the past (platoon, section 4): every radius since the last good frame was computed as if no frame were lost. */
void Hold::correct_past()
{
    const long k = static_cast<long>(value_.size());
    for (long past = last_ + 1; past < k; ++past) {
        const std::vector<double> radius = careful(*sent_, past - last_);
        if (radius != radius_[at(past)]) {
            radius_[at(past)] = radius;
            rewound_ = true;
        }
    }
    doubt_   = false; /* nothing relies on silence any more */
    wounded_ = true;
}

void Hold::take(const Frame &frame)
{
    const bool loss = sent_ && (!frame.continues || lost_);
    if (loss) {
        correct_past();
    }
    in_row_  = (loss || !sent_) ? 1 : std::min(in_row_ + 1, 2);
    wounded_ = lost_behind_ || (wounded_ && in_row_ < 2);
    if (sent_) {
        previous_ = *sent_;
    }
    sent_        = frame.code;
    last_        = static_cast<long>(value_.size());
    lost_        = lost_behind_;
    lost_behind_ = false;
    doubt_       = false;
}

/* No frame came for this sample; by interval_max the sender must have spoken (trigger.h), so its frame is lost. */
std::vector<double> Hold::wait(long age)
{
    lost_ = lost_ || age >= receiver_.trigger.interval_max;
    if (lost_) {
        correct_past();
        return careful(*sent_, age);
    }
    const std::vector<double> radius = trusting(age);
    doubt_ = doubt_ || radius != careful(*sent_, age);
    return radius;
}

void Hold::step()
{
    std::vector<double> value  = receiver_.middle;
    std::vector<double> radius = receiver_.span;
    rewound_ = false;
    if (fresh_) {
        take(*fresh_);
        for (size_t g = 0; g < radius.size(); ++g) {
            if ((*sent_)[g]) { radius[g] = receiver_.half[g]; }
        }
    } else if (sent_) {
        radius = wait(static_cast<long>(value_.size()) - last_);
    }
    for (size_t g = 0; sent_ && g < value.size(); ++g) {
        if ((*sent_)[g]) { value[g] = decode(receiver_.scale[g], *(*sent_)[g]); }
    }
    fresh_.reset();
    value_.push_back(value);
    radius_.push_back(radius);
}

Bus Hold::health() const
{
    if (!sent_) {
        return Bus::absent;
    }
    if (static_cast<long>(value_.size()) - 1 - last_ > receiver_.trigger.interval_max + receiver_.margin) {
        return Bus::stale;
    }
    return wounded_ ? Bus::lossy : Bus::good;
}

/* ---- Residuals ---- */

Cascade::Cascade(const Generator &generator)
    : g_(&generator), z_(Vector::Zero(generator.G.rows())), x_(Vector::Zero(generator.G.rows()))
{
}

Vector Cascade::step(const Vector &y, const Vector &u)
{
    const Vector r0 = g_->V * y - g_->W * z_ - g_->Qu * u;
    const Vector r  = g_->Mo * r0 - g_->Mo * (g_->W * x_);
    const Vector x  = (g_->G - g_->Lo * g_->W) * x_ + g_->Lo * r0;
    const Vector z  = g_->G * z_ + g_->H * u + g_->L * y;
    x_ = x;
    z_ = z;
    return r;
}

/* ---- The exact hull ---- */

Hull::Hull(const Generator &generator, const Plant &plant, const Vector &initial)
    : generator_(generator), plant_(plant), initial_(initial)
{
    const Eigen::Index n = plant.A.rows();
    const Eigen::Index m = generator.V.cols();
    const Eigen::Index p = generator.H.cols();
    const Eigen::Index q = plant.Ed.cols();
    const Probe        still{Vector::Zero(n), Vector::Zero(m), Vector::Zero(p), Vector::Zero(q), Cascade(generator)};
    y_probe_.assign(at(m), still);
    u_probe_.assign(at(p), still);
    d_probe_.assign(at(q), still);
    x_probe_.assign(at(initial.size()), still);
    for (Eigen::Index i = 0; i < m; ++i) { y_probe_[at(i)].y(i) = 1.0; }
    for (Eigen::Index i = 0; i < p; ++i) { u_probe_[at(i)].u(i) = 1.0; }
    for (Eigen::Index i = 0; i < q; ++i) { d_probe_[at(i)].d(i) = 1.0; }
    for (Eigen::Index i = 0; i < initial.size(); ++i) { x_probe_[at(i)].state(i) = 1.0; }
}

/* One more sample of every probe. An event error of an input is an error of what the cascade is told, not of what the plant does. */
Matrix Hull::respond(std::vector<Probe> &probes, bool first) const
{
    Matrix response(generator_.Mo.rows(), static_cast<Eigen::Index>(probes.size()));
    for (size_t i = 0; i < probes.size(); ++i) {
        Probe &p = probes[i];
        Vector y = first ? p.y : Vector::Zero(p.y.size());
        Vector u = first ? p.u : Vector::Zero(p.u.size());
        Vector d = first ? p.d : Vector::Zero(p.d.size());
        if (plant_.A.rows() > 0) {
            y += plant_.C * p.state + plant_.Fd * d;
            p.state = plant_.A * p.state + plant_.Ed * d;
        }
        response.col(static_cast<Eigen::Index>(i)) = p.cascade.step(y, u).cwiseAbs();
    }
    return response;
}

void Hull::extend(size_t lag)
{
    while (y_.size() <= lag) {
        const bool first = y_.empty();
        y_.push_back(respond(y_probe_, first));
        u_.push_back(respond(u_probe_, first));
        d_.push_back(respond(d_probe_, first));
        x_.push_back(respond(x_probe_, first));
    }
}

/* platoon, section 6: J(k) = sum over the whole past of |response(lag)| bound(k - lag); disturbances are bounded by 1. */
Vector Hull::threshold(const std::vector<Vector> &y_radius, const std::vector<Vector> &u_radius)
{
    const size_t k = y_radius.size() - 1;
    extend(k);
    Vector J = x_[k] * initial_;
    for (size_t lag = 0; lag <= k; ++lag) {
        J += y_[lag] * y_radius[k - lag] + u_[lag] * u_radius[k - lag] + d_[lag].rowwise().sum();
    }
    return J;
}

/* ---- The decision ---- */

void Decision::judge(size_t generator, const Evidence &evidence)
{
    Judge         &j         = judge_[generator];
    const bool     alarm     = evidence.alarm[generator];
    const bool     confirmed = j.state == State::confirmed;
    const unsigned doubt     = evidence.doubt & rules_.feeds[generator];

    if (!confirmed && (j.pending & evidence.rewound) != 0) { /* a frame was lost: taken back, judged anew below */
        j = Judge{};
    }
    j.pending &= doubt; /* a group that is no longer in doubt has settled what relied on it */
    j.alarms = alarm ? std::min(j.alarms + 1, rules_.up) : 0;
    j.quiet  = alarm ? 0 : j.quiet + 1;
    if (j.state == State::none) {
        j.pending = alarm ? (j.pending | doubt) : 0U;
        if (j.alarms >= rules_.up) {
            j.state = State::provisional;
        }
    }
    if (j.state == State::provisional && j.pending == 0) {
        j.state = State::confirmed;
    }
    if (confirmed && !rules_.latch && j.quiet >= rules_.down) {
        j = Judge{};
    }
}

State Decision::step(const Evidence &evidence)
{
    State worst = State::none;
    for (size_t i = 0; i < judge_.size(); ++i) {
        judge(i, evidence);
        worst = std::max(worst, judge_[i].state);
    }
    for (size_t i = 0; i < judge_.size(); ++i) { proven_[i] = worst != State::none && (proven_[i] || judge_[i].state == State::confirmed); }
    return (worst == State::none && !evidence.ready) ? State::starting : worst;
}

std::uint32_t Decision::candidates() const
{
    State worst = State::none;
    for (const Judge &j : judge_) { worst = std::max(worst, j.state); }
    if (worst == State::none) { return 0U; }
    std::uint32_t common = 0xFFFFFFFFU;
    for (size_t i = 0; i < judge_.size(); ++i) { /* only what is sure narrows what is sure, and it does so for the whole episode */
        if (proven_[i] || judge_[i].state == worst) { common &= rules_.faults[i]; }
    }
    return common;
}

/* ---- An unknown-input observer ---- */

namespace {

/* [e^(A t), integral of e^(A s) M] from e^([A M; 0 0] t), by halving until the series is short. */
Matrix exponential(const Matrix &m)
{
    int    halvings = 0;
    double norm     = m.cwiseAbs().rowwise().sum().maxCoeff();
    for (; norm > 0.25; norm *= 0.5) { ++halvings; }
    const Matrix small = m * std::pow(0.5, halvings);
    Matrix       sum = Matrix::Identity(m.rows(), m.cols()), term = sum;
    for (int i = 1; i < 20; ++i) {
        term = term * small / i;
        sum += term;
    }
    for (; halvings > 0; --halvings) { sum = sum * sum; }
    return sum;
}

} // namespace

UnknownInputObserver::UnknownInputObserver(const UnknownInputPlant &p, const Matrix &K1, double t, const Vector &low) : low_(low)
{
    const Eigen::Index n = p.A.rows(), m = p.C.rows(), inputs = p.B.cols(), q = p.G.cols();
    const Matrix       CG = p.C * p.G;
    H = p.G * (CG.transpose() * CG).inverse() * CG.transpose();
    const Matrix T = Matrix::Identity(n, n) - H * p.C;
    F = T * p.A - K1 * p.C;
    K = K1 + F * H;
    Matrix hold = Matrix::Zero(n + 2 * m, n + 2 * m); /* z' = F z + K y, y' a constant */
    hold.topLeftCorner(n, n) = F;
    hold.block(0, n, n, m) = K;
    hold.block(n, n + m, m, m) = Matrix::Identity(m, m) / t;
    hold = exponential(hold * t);
    Fd  = hold.topLeftCorner(n, n);
    K1d = hold.block(0, n + m, n, m);
    K0  = hold.block(0, n, n, m) - K1d;
    Matrix known = Matrix::Zero(n + inputs, n + inputs);
    known.topLeftCorner(n, n) = F;
    known.topRightCorner(n, inputs) = T * p.B;
    Bz = exponential(known * t).topRightCorner(n, inputs);
    Matrix drive = Matrix::Zero(n + inputs + q, n + inputs + q);
    drive.topLeftCorner(n, n) = p.A;
    drive.block(0, n, n, inputs) = p.B;
    drive.block(0, n + inputs, n, q) = p.G;
    drive = exponential(drive * t);
    Ad = drive.topLeftCorner(n, n);
    Bd = drive.block(0, n, n, inputs);
    Gd = drive.block(0, n + inputs, n, q);
    inverse = (Gd.transpose() * Gd).inverse() * Gd.transpose();
    z_ = xhat_ = Vector::Zero(n);
    y_ = Vector::Zero(m);
    u_ = Vector::Zero(inputs);
    f_ = Vector::Zero(q);
}

void UnknownInputObserver::step(const Vector &y, const Vector &u)
{
    z_ = Fd * z_ + K0 * y_ + K1d * y + Bz * u_;
    const Vector x = z_ + H * y;
    f_ += low_.cwiseProduct(inverse * (x - Ad * xhat_ - Bd * u_) - f_);
    xhat_ = x;
    y_ = y;
    u_ = u;
}

/* ---- Banks ---- */

void Bank::step(const Vector &value, const Vector &radius)
{
    value_.push_back(value);
    radius_.push_back(radius);
    ++since_;
}

bool Bank::ready() const
{
    return since_ >= certificates_.front().weight.rows();
}

double Bank::residual(size_t certificate) const
{
    const Matrix &w = certificates_[certificate].weight;
    double        r = 0.0;
    for (Eigen::Index lag = 0; lag < w.rows(); ++lag) { r += w.row(lag).dot(value_[value_.size() - 1U - static_cast<size_t>(lag)]); }
    return r;
}

double Bank::moved(size_t certificate) const
{
    const Matrix &w = certificates_[certificate].weight;
    double        sum = 0.0;
    for (Eigen::Index lag = 0; lag < w.rows(); ++lag) {
        sum += w.row(lag).cwiseAbs().dot(value_[value_.size() - 1U - static_cast<size_t>(lag)].cwiseAbs());
    }
    return sum;
}

double Bank::threshold(size_t certificate) const
{
    const Certificate &c = certificates_[certificate];
    double             J = c.bias;
    for (Eigen::Index lag = 0; lag < c.weight.rows(); ++lag) {
        const Vector &radius = radius_[radius_.size() - 1U - static_cast<size_t>(lag)];
        J += widen_ * c.weight.row(lag).cwiseAbs().dot(radius.head(c.weight.cols())) + c.extra.row(lag).dot(radius);
    }
    return J;
}

} // namespace oracle
