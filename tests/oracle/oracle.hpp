/** @file
 *  What the library must compute, once more: double precision, plain and brute force, written from the method note (platoon) and from the
 *  text of the public headers only. It shares no code and no formula with the library, and where a shorter way exists it takes the longer:
 *  observer and post-filter stay two systems, the threshold is a convolution over the whole past, the hold keeps every sample it ever gave. */
#ifndef HULLGUARD_ORACLE_HPP
#define HULLGUARD_ORACLE_HPP

#include <Eigen/Dense>

#include <cstdint>
#include <optional>
#include <vector>

namespace oracle {

using Matrix = Eigen::MatrixXd;
using Vector = Eigen::VectorXd;

/* ---- Codes and the trigger (platoon, section 4; trigger.h) ---- */

using Code  = std::optional<double>; /* an integer, which a double holds exactly; empty where the sender had no value */
using Codes = std::vector<Code>;
using Table = std::vector<std::vector<double>>; /* [row][channel] */

struct Scale {
    double resolution = 1.0;
    double offset     = 0.0;
    double minimum    = 0.0;
    double maximum    = 0.0;
};

Code   encode(const Scale &scale, double value);
double decode(const Scale &scale, double code);

struct Trigger {
    int                 interval_max = 1;
    std::vector<int>    silence;  /* [levels] */
    Table               delta;    /* [levels][width] 1/65536 */
    Table               sigma;    /* [levels][width] codes */
    Table               activity; /* [levels][width] codes */
    std::vector<double> zero;     /* [width] codes */

    int    levels() const { return static_cast<int>(silence.size()); }
    int    width() const { return static_cast<int>(zero.size()); }
    double threshold(int level, int channel, const Code &sent) const;
    int    level(const Codes &sent, const Codes &previous) const;
};

/** A sender: says at which samples it speaks. */
class Sender {
public:
    explicit Sender(const Trigger &trigger) : trigger_(trigger) {}
    bool step(const Codes &code);

private:
    const Trigger &trigger_;
    long           k_    = -1;
    long           last_ = -1;
    int            level_ = 0;
    Codes          sent_;
};

/* ---- The hold (platoon, section 4; hold.h) ---- */

enum class Bus { absent = 0, good = 1, lossy = 2, stale = 3 };

struct Receiver {
    Trigger             trigger;
    int                 margin = 0;
    std::vector<Scale>  scale;  /* [width] */
    std::vector<double> half;   /* [width] */
    Table               slew;   /* [interval_max + margin][width] */
    std::vector<double> span;   /* [width] */
    std::vector<double> middle; /* [width] */
};

struct Frame {
    Codes code;
    bool  continues = true;
};

/** Value and radius of a group at every sample so far. The past is kept whole, so that rewriting it is an assignment. */
class Hold {
public:
    explicit Hold(const Receiver &receiver) : receiver_(receiver) {}

    bool receive(const Frame &frame); /* false: the open sample already has one */
    void lose();
    void step();

    const std::vector<double> &value() const { return value_.back(); }
    const Table               &values() const { return value_; }  /* [sample][channel] */
    const Table               &radii() const { return radius_; }  /* [sample][channel] as known now */
    bool                       rewound() const { return rewound_; } /* did the last step correct a past radius? */
    bool                       doubt() const { return doubt_; }
    Bus                        health() const;

private:
    std::vector<double> careful(const Codes &sent, long age) const;
    std::vector<double> trusting(long age) const;
    std::vector<double> wait(long age);
    void                take(const Frame &frame);
    void                correct_past();

    const Receiver      &receiver_;
    Table                value_;
    Table                radius_;
    std::optional<Frame> fresh_;
    std::optional<Codes> sent_;
    Codes                previous_;
    long                 last_    = -1; /* sample of the last good frame */
    int                  in_row_  = 0;  /* good frames without a loss between them */
    bool                 lost_    = false; /* a loss is known since the last good frame */
    bool                 lost_behind_ = false; /* one that was noted after the frame of the same sample */
    bool                 wounded_ = false; /* a loss, and not yet two good frames in a row since */
    bool                 doubt_   = false;
    bool                 rewound_ = false;
};

/* ---- Residuals (platoon, sections 2 and 3) ---- */

struct Plant {
    Matrix A, B, C, D, Ed, Fd;
};

struct Generator {
    Matrix G, H, L, W, V, Qu, Lo, Mo;
};

/** Observer and dynamic post-filter in series, both from zero:
 *      z(k+1) = G z + H u + L y          r0 = V y - W z - Qu u
 *      x(k+1) = (G - Lo W) x + Lo r0     r  = Mo r0 - Mo W x        which is R(z) = Mo - Mo W (zI - G + Lo W)^-1 Lo */
class Cascade {
public:
    explicit Cascade(const Generator &generator);
    Vector        step(const Vector &y, const Vector &u);
    const Vector &observer() const { return z_; }
    const Vector &filter() const { return x_; }

private:
    const Generator *g_;
    Vector           z_, x_;
};

/** The exact hull by simulation: every source of residual (event error of an output, of an input, a disturbance, a component of the
 *  initial state) is a unit impulse sent through plant and cascade; the sum of |response| x bound over the whole past is J. */
class Hull {
public:
    /** The plant is needed for disturbances and initial state; pass an empty initial range and no Ed columns for none. */
    Hull(const Generator &generator, const Plant &plant, const Vector &initial);

    /** Radii of all samples 0 .. k, newest last. */
    Vector threshold(const std::vector<Vector> &y_radius, const std::vector<Vector> &u_radius);

    const Matrix &of_y(std::size_t lag) { extend(lag); return y_[lag]; } /* |response|, residuals x outputs */
    const Matrix &of_u(std::size_t lag) { extend(lag); return u_[lag]; }
    const Matrix &of_d(std::size_t lag) { extend(lag); return d_[lag]; }
    const Matrix &of_x(std::size_t lag) { extend(lag); return x_[lag]; }

private:
    struct Probe {
        Vector  state; /* of the plant */
        Vector  y, u, d; /* the impulse, at lag 0 only */
        Cascade cascade;
    };
    void   extend(std::size_t lag);
    Matrix respond(std::vector<Probe> &probes, bool first) const;

    const Generator    &generator_;
    const Plant        &plant_;
    Vector              initial_;
    std::vector<Probe>  y_probe_, u_probe_, d_probe_, x_probe_;
    std::vector<Matrix> y_, u_, d_, x_; /* [lag] */
};

/* ---- An unknown-input observer (suspension, sections 1.1 and 1.4; uio.h) ---- */

/** x' = A x + B u + G f, y = C x, rank CG = columns of G. */
struct UnknownInputPlant {
    Matrix A, B, G, C;
};

/** The observer as it is derived, with y linear between samples, u and f constant, and f reconstructed from two estimates of the state. */
class UnknownInputObserver {
public:
    /** K1 makes F stable; low: of each entry of f, 0 < low <= 1. */
    UnknownInputObserver(const UnknownInputPlant &plant, const Matrix &K1, double sample_time, const Vector &low);
    void          step(const Vector &y, const Vector &u); /* everything before the first sample is 0 */
    const Vector &state() const { return xhat_; }
    const Vector &input() const { return f_; }

    Matrix H, F, K, Fd, K0, K1d, Bz, Ad, Bd, Gd, inverse; /* Bz: what u does to z in a sample; inverse: Gd^+ */

private:
    Vector low_, z_, y_, u_, xhat_, f_;
};

/* ---- Banks of certificates (platoon, section 7; bank.h) ---- */

/** A parity vector over the last samples, the newest first, and over whole rows: 0 where a signal is not read. */
struct Certificate {
    Matrix weight; /* [window][values] */
    Matrix extra;  /* [window][radii] >= 0, of radii that stand for no value */
    double bias = 0.0;
};

/** r and J of every certificate from everything that was ever held. */
class Bank {
public:
    Bank(const std::vector<Certificate> &certificates, double widen) : certificates_(certificates), widen_(widen) {}
    void    step(const Vector &value, const Vector &radius);
    void    reset() { since_ = 0; }
    bool    ready() const;
    Vector &radius(long lag) { return radius_[radius_.size() - 1U - static_cast<std::size_t>(lag)]; } /* may turn out to have been another */
    long    samples() const { return static_cast<long>(radius_.size()); }
    double  residual(std::size_t certificate) const;
    double  threshold(std::size_t certificate) const;
    double  moved(std::size_t certificate) const; /* sum of |weight value|: what rounding of r is a share of */

private:
    const std::vector<Certificate> &certificates_;
    double                          widen_;
    std::vector<Vector>             value_, radius_; /* [sample] */
    long                            since_ = 0;
};

/* ---- The decision (platoon, section 4, "Confirmation"; decision.h) ---- */

enum class State { starting = 0, none = 1, provisional = 2, confirmed = 3 };

struct Rules {
    std::vector<unsigned>      feeds;  /* [generators] bit mask of groups */
    std::vector<std::uint32_t> faults; /* [generators] */
    int                        up    = 1;
    int                        down  = 1;
    bool                       latch = false;
};

struct Evidence {
    std::vector<bool> alarm; /* [generators] */
    bool              ready   = true;
    unsigned          doubt   = 0;
    unsigned          rewound = 0;
};

class Decision {
public:
    explicit Decision(const Rules &rules) : rules_(rules), judge_(rules.feeds.size()), proven_(rules.feeds.size(), false) {}
    State         step(const Evidence &evidence);
    std::uint32_t candidates() const;
    void          reset()
    {
        judge_.assign(judge_.size(), Judge{});
        proven_.assign(proven_.size(), false);
    }

private:
    struct Judge {
        State    state   = State::none;
        int      alarms  = 0; /* in a row */
        int      quiet   = 0; /* in a row */
        unsigned pending = 0; /* groups whose silence the alarms so far rely on */
    };
    void judge(std::size_t generator, const Evidence &evidence);

    const Rules       &rules_;
    std::vector<Judge> judge_;
    std::vector<bool>  proven_; /* confirmed since the plant was last without an alarm, healed or not */
};

} // namespace oracle

#endif
