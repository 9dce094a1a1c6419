//! Keys of `result.json`. Meanings in full are on the fields of [`crate::workflow::identify::IdentificationResult`].

use crate::workflow::identify::result::identification::{FORMAT, VERSION};
use ff_mission::mission::schema::Holds::{
    Either, Flag, Just, Matrix, Number, Numbers, OneOf, Pairs, Table, Tables, Terms, Text, Texts, Vector, Whole, Words,
};
use ff_mission::mission::schema::{Key, key, must};

pub(super) const ROOT: &[Key] = &[
    must("format", OneOf(&[FORMAT]), "what this file is"),
    must("version", Just(VERSION), "version of the format"),
    must("robot", Text, "name of the robot"),
    must("method", OneOf(&["rda", "output_error", "ground"]), "how the record was predicted"),
    must("verdict", Texts, "what was found, and what was not; the most important first"),
    key("evidence", Table(EVIDENCE), "what the record says of the model as a whole"),
    must("status", Either(STATUS), "how the fit ended"),
    must("iterations", Whole, "linearisations used"),
    key("descent", Tables(DESCENT), "linearisations that led to the estimates, and the estimates themselves"),
    must("chi2_per_dof", Number, "sum of squared whitened residuals over the degrees of freedom"),
    must("residuals", Whole, "number of residuals"),
    must("parameters", Tables(PARAMETER), "the parameters asked for"),
    must("nuisance", Tables(PARAMETER), "biases, friction and initial state, estimated beside them"),
    must("model", Tables(VALUE), "every parameter of the model with the estimates in place"),
    must("rank", Whole, "numerical rank of the scaled sensitivities of the data alone"),
    must("singular_values", Numbers, "their singular values, descending"),
    must("null_directions", Tables(COMBINATION), "combinations on which the record is silent"),
    must("weak_directions", Tables(COMBINATION), "combinations told to worse than their own size, weakest first"),
    must("priors_cover", Flag, "whether priors hold every null direction"),
    key("silent", Table(SILENT), "null directions, told apart"),
    key("reduced", Table(REDUCED), "what was estimated in place of what was asked for"),
    key("prior_conflicts", Tables(CONFLICT), "priors that the data contradict, the worst first"),
    key("uncertain", Tables(UNCERTAIN), "what the mission is not sure of, before and after"),
    key("over_time", Tables(COURSE), "what changes: parameters from record to record, biases that walk within one"),
    key("budget", Tables(BUDGET), "where the variance of every parameter comes from"),
    key("not_allowed_for", Texts, "what the mission is not sure of and the method takes as exact"),
    key("taken_as_exact", Tables(HARM), "what small errors of what is taken as exact would do"),
    key("bodies", Tables(BODY), "bodies of which something was estimated, about their centres of mass"),
    key("profiles", Tables(PROFILE), "intervals from the likelihood itself"),
    key("sampled", Table(SAMPLED), "what draws from the posterior say"),
    key("minima", Table(MINIMA), "where other starts led"),
    must("correlations", Tables(CORRELATION), "pairs with a correlation of 0.95 or more"),
    must("covariance", Table(COVARIANCE), "covariance of parameters and nuisance, priors included"),
    key("posterior", Table(POSTERIOR), "what is known of the parameters: the prior of a later identification"),
    key("whiteness", Tables(WHITENESS), "residuals of every channel against white noise"),
    must("modes", Tables(MODE), "modes of the identified model at the pose of the mission, joints held"),
    key("decay", Tables(DECAY), "modes of the free decay in the records"),
    key("clocks", Tables(CLOCK), "clocks of the channels against that of the encoders"),
    key("comparison", Table(COMPARISON), "models against each other"),
    key("records", Tables(RECORD_FIT), "every record, when there are several"),
    key("kept_records", Tables(KEPT_RECORD), "the records as files of the folder, for a later identification"),
    must("channels", Tables(CHANNEL), "every channel over the first record"),
    key("held_out", Table(HELD_OUT), "the same on data that were not used"),
    must("warnings", Tables(WARNING), "what was let through"),
    must("provenance", Table(PROVENANCE), "where all this comes from"),
];

const STATUS: &[&[Key]] = &[
    &[must("status", OneOf(&["converged", "iteration_limit"]), "at a minimum, or out of iterations")],
    &[
        must("status", OneOf(&["flat"]), "at a minimum that is flat along one combination"),
        must("along", Text, "that combination"),
    ],
    &[
        must("status", OneOf(&["at_bound"]), "at a minimum of a bounded problem"),
        must("at", Texts, "parameters that want to leave their bounds"),
    ],
    &[
        must("status", OneOf(&["stalled"]), "no step helps: not a solution"),
        must("promised", Number, "relative reduction still promised"),
    ],
    &[
        must("status", OneOf(&["interrupted"]), "ended from outside: not a solution"),
        must("after", Whole, "linearisations until then"),
    ],
];

const DESCENT: &[Key] = &[
    must("cost", Number, "what was minimised, per residual"),
    must("residuals", Whole, "residuals of this pass: fewer over a thinned record or a part of it"),
];

const EVIDENCE: &[Key] = &[
    must("state", OneOf(&["explained", "contradicted", "not-tested"]), "what it comes to"),
    must("reason", Text, "why, in one line"),
    must("false_alarms", Number, "how often a right model would be contradicted by all tests together"),
    must("tried", Whole, "errors that were tried"),
    key("independent", Number, "independent tests that these are worth"),
    key("explained", Number, "part of chi-squared above its expectation that the errors named together account for"),
    key("motion_noise", Number, "part of the squared residuals that is noise of the encoders"),
    key(
        "with_first",
        OneOf(&["explained", "contradicted", "not-tested"]),
        "what it would come to with the first error estimated",
    ),
    key("below_hz", Number, "frequency (Hz) below which alone torques and base rates were compared"),
    key("named", Tables(NAMED), "errors that the record speaks for: those that explain it together, then others alone"),
    key("columns", Texts, "units, axes and signs of the record that may be why it is not explained"),
];

const NAMED: &[Key] = &[
    must("name", Text, "its name, as --adopt takes it"),
    must("text", Text, "in words, with its size"),
    must("size", Tables(SIZE), "its components"),
    must("drop", Number, "by how much chi-squared falls with it"),
    must("freedom", Whole, "number of components"),
    must("p", Number, "how often such a drop would be met were nothing wrong"),
    must("moves", Text, "the estimate that moves most with it"),
    must("moves_by", Number, "by how many of its standard deviations"),
    must("beside", Flag, "whether it adds to those before it"),
    key("alike", Texts, "errors whose effect on this record is nearly the same"),
    key("refitted", Flag, "whether these are figures of a fit that estimates it; else of a score test"),
    key("mission", Text, "what to add to the mission to have it in the model, as TOML"),
];

const SIZE: &[Key] = &[
    must("name", Text, "what tells it from the others"),
    must("unit", Text, "SI unit; 1 is relative"),
    must("value", Number, "its size"),
    must("std", Number, "standard deviation"),
];

const PARAMETER: &[Key] = &[
    must("name", Text, "full name"),
    must("unit", Text, "SI unit"),
    must("start", Number, "where the fit started"),
    must("value", Number, "estimate"),
    key("std", Number, "standard deviation; absent where data and priors cannot tell"),
    key(
        "std_coloured",
        Number,
        "the same, allowing for random noise of the colour that the residuals have; absent where they are white",
    ),
    key("interval95", Vector(2), "95 % interval"),
    key("prior_mean", Number, "mean of its prior"),
    key("prior_std", Number, "standard deviation of its prior"),
    key("truth", Number, "what it was when the record was simulated; absent unless the truth was given"),
    must("verdict", OneOf(&["estimated", "weak", "prior_only", "at_bound", "not_identifiable"]), "what the data say"),
];

const VALUE: &[Key] = &[must("name", Text, "full name"), must("unit", Text, "SI unit"), must("value", Number, "value")];

const COMBINATION: &[Key] = &[
    must("singular_value", Number, "singular value of the scaled sensitivities along it"),
    must("terms", Terms, "change of each parameter along it, in its own unit"),
    must("omitted", Whole, "smaller parts left out"),
    must("text", Text, "in words"),
];

const SILENT: &[Key] = &[
    must("structural", Tables(COMBINATION), "what no record of this robot can tell"),
    must("unexcited", Tables(COMBINATION), "what another motion, or more sensors, might tell"),
];

const REDUCED: &[Key] = &[
    must("held", Texts, "parameters held, because others stand for them"),
    must("values", Tables(VALUE), "the same with their values, those of the mission"),
    must("combinations", Tables(STANDS), "what was estimated, and for what it stands"),
];

const STANDS: &[Key] = &[
    must("name", Text, "the one among the unknowns"),
    must("terms", Terms, "those held, with what each unit of them adds to it"),
    must("text", Text, "in words"),
];

const CONFLICT: &[Key] = &[
    must("name", Text, "full name of the parameter"),
    must("unit", Text, "SI unit"),
    must("prior_mean", Number, "mean of the prior"),
    must("prior_std", Number, "its standard deviation"),
    must("data_value", Number, "what the record says without this prior"),
    must("data_std", Number, "the standard deviation of that"),
    must("deviations", Number, "standard deviations of the difference that they are apart"),
];

const KINDS: &[&str] = &[
    "masses",
    "centres_of_mass",
    "inertias",
    "parameters",
    "mounts",
    "joints",
    "torque_gains",
    "gyro_scale",
    "gyro_alignment",
    "encoder_offsets",
    "changes",
    "bias_walks",
    "joint_terms",
    "drive_gains",
];

const UNCERTAIN: &[Key] = &[
    must("name", Text, "its name"),
    must("unit", Text, "SI unit"),
    must("kind", OneOf(KINDS), "what kind of thing it is"),
    must("prior_mean", Number, "what the mission says"),
    must("prior_std", Number, "and its standard deviation"),
    must("value", Number, "what mission and record say together"),
    key("std", Number, "its standard deviation; absent where it is not determined"),
];

const COURSE: &[Key] = &[
    must("name", Text, "a parameter, or the bias of a channel"),
    must("unit", Text, "SI unit"),
    key("record", Text, "the record within which a bias walks; absent for what changes from record to record"),
    must("points", Tables(COURSE_POINT), "in the order of time"),
];

const COURSE_POINT: &[Key] = &[
    must("at", Number, "seconds since the first sample of the record, or the number of the record from 1"),
    key("record", Text, "the record"),
    must("value", Number, "there"),
    key("std", Number, "its standard deviation; absent where it is not determined"),
];

const BUDGET: &[Key] = &[
    must("name", Text, "parameter"),
    must("unit", Text, "SI unit"),
    must("std", Number, "its standard deviation"),
    must("noise", Number, "part of the variance that is due to the noise of the sensors"),
    key(
        "minima",
        Number,
        "part that is due to other minima between which the record does not choose; absent where there is one minimum",
    ),
    must("errors", Tables(SHARE), "part that is due to each kind of error, the largest first"),
    key("better", Table(BETTER), "what would help most"),
];

const SHARE: &[Key] =
    &[must("kind", OneOf(KINDS), "kind of error"), must("share", Number, "part of the variance, 0 to 1")];

const BETTER: &[Key] = &[
    must("kind", OneOf(KINDS), "what would be known better"),
    must("factor", Number, "by which factor"),
    must("std", Number, "standard deviation of the parameter then"),
];

const HARM: &[Key] = &[
    must("name", Text, "the error"),
    must("size", Text, "its size"),
    must("moves", Text, "the parameter that would be wrong by most of its deviations"),
    must("moves_by", Number, "by how many"),
];

const BODY: &[Key] = &[
    must("name", Text, "name of the body"),
    must("quantities", Tables(QUANTITY), "mass, centre of mass, inertia about it"),
    must("principal", Tables(AXIS), "principal axes, smallest moment first"),
];

const QUANTITY: &[Key] = &[
    must("name", Text, "mass, com_x to com_z, inertia_com_xx to inertia_com_zz"),
    must("unit", Text, "SI unit"),
    must("start", Number, "value at the start of the fit"),
    must("value", Number, "value"),
    key("std", Number, "standard deviation; absent where it is not determined"),
    key("change_percent", Number, "change against the start (%)"),
];

const AXIS: &[Key] = &[
    must("moment_kgm2", Number, "moment (kg m^2)"),
    key("moment_std_kgm2", Number, "its standard deviation (kg m^2)"),
    key("change_percent", Number, "change of the moment against the start (%)"),
    must("axis", Vector(3), "unit vector in the frame of the body"),
    key("axis_std_rad", Number, "standard deviation of its direction (rad); absent where another moment is as large"),
];

const PROFILE: &[Key] = &[
    must("name", Text, "full name"),
    must("unit", Text, "SI unit"),
    must("value", Number, "estimate"),
    key("gaussian95", Vector(2), "the Gaussian interval beside it"),
    key("lower95", Number, "lower end; absent where the data put no bound as far as was looked"),
    key("upper95", Number, "upper end"),
    must("points", Pairs, "values, and twice the negative log posterior above its minimum there"),
    key(
        "bent",
        Flag,
        "whether it was looked for because the cost is no parabola there; the deviation of the parameter allows for it",
    ),
];

const SAMPLED: &[Key] = &[
    must(
        "state",
        OneOf(&["converged", "not-converged", "interrupted", "not-drawn"]),
        "whether its intervals can be trusted",
    ),
    must("reason", Text, "why, in one line"),
    must("sampler", Text, "how it was drawn"),
    must("chains", Whole, "number of chains"),
    must("draws", Whole, "draws of each of them"),
    must("warm_up", Whole, "draws before them that tuned the steps"),
    must("seed", Whole, "seed of all randomness"),
    must("evaluations", Whole, "evaluations of residuals and their derivatives"),
    key("predictions", Whole, "predictions of all rows that draws of a density nearby were weighed with"),
    key("pareto_k", Number, "shape of the tail of their weights, which are trusted below 0.7"),
    key("effective_weights", Number, "number of draws with equal weights that they are worth"),
    must(
        "divergences",
        Whole,
        "trajectories that met the edge of what is physical, or lost their energy; draws for which no solution was found",
    ),
    key("r_hat", Number, "the largest R-hat"),
    key("ess_bulk", Number, "the least effective sample size of the bulk"),
    key("ess_tail", Number, "the least effective sample size of the tails"),
    key("file", Text, "the file of all draws"),
    must("parameters", Tables(SAMPLED_LINE), "the parameters asked for"),
    must("beside", Tables(SAMPLED_LINE), "what was drawn beside them"),
];

const SAMPLED_LINE: &[Key] = &[
    must("name", Text, "full name"),
    must("unit", Text, "SI unit"),
    key("r_hat", Number, "rank-normalised split R-hat"),
    key("ess_bulk", Number, "effective sample size of the bulk"),
    key("ess_tail", Number, "effective sample size of the tails"),
    key("mean", Number, "mean of the draws; absent, as all below, where chains have not converged"),
    key("std", Number, "their standard deviation"),
    key("median", Number, "their median"),
    key("interval95", Vector(2), "their 2.5 % and 97.5 % quantiles"),
    key("hdi95", Vector(2), "the shortest interval that holds 95 % of them"),
    key("differs", Number, "largest distance of an end of interval95 from that of the fit, in its standard deviations"),
];

const MINIMA: &[Key] = &[
    must("starts", Whole, "starts that were tried"),
    must("converged", Whole, "how many of them converged"),
    must("objectives", Numbers, "twice the negative log posterior of every distinct minimum, ascending"),
    key(
        "alternatives",
        Tables(ALTERNATIVE),
        "parameters that differ between minima of which the record does not choose one",
    ),
];

const ALTERNATIVE: &[Key] = &[
    must("name", Text, "full name"),
    must("unit", Text, "SI unit"),
    must("values", Numbers, "its value at every minimum, in their order; the first is the estimate"),
    must("stds", Numbers, "its standard deviation at each of them alone; deviations of the result cover all"),
];

const CORRELATION: &[Key] =
    &[must("first", Text, "one unknown"), must("second", Text, "the other"), must("value", Number, "coefficient")];

const COVARIANCE: &[Key] = &[
    must("names", Texts, "unknowns, in the order of rows and columns"),
    must("rows", Matrix, "covariance in the units of the unknowns"),
];

const POSTERIOR: &[Key] = &[
    must("names", Texts, "full names"),
    must("units", Texts, "SI units"),
    must("sizes", Numbers, "what a relative change of 1 means"),
    must("mean", Numbers, "means, in these units"),
    must("rows", Matrix, "whitened: rows (p - mean) are standard normal"),
];

const WHITENESS: &[Key] = &[
    must("channel", Text, "channel, such as tau.joint2"),
    must("mean_square", Number, "mean square of the whitened residuals"),
    must("white_p", Number, "how often white noise would look at least as coloured (Bartlett)"),
    must("portmanteau_p", Number, "the same by Ljung and Box"),
    must("normal_p", Number, "how often normal noise would look at least as skewed or heavy-tailed (Jarque, Bera)"),
    must("first_correlation", Number, "first autocorrelation"),
    must("largest", Number, "largest residual in standard deviations"),
    must("white", Flag, "white at a level of 0.5 % over all channels"),
    key(
        "excess_p",
        Number,
        "how often white noise no larger than assumed would show as much power in a part of the spectrum",
    ),
    key("excess", Flag, "whether that speaks against the model, at a level of 0.5 % over all channels"),
    key("peak_hz", Number, "where the power of residuals that are not white is largest (Hz)"),
    must("stands_out_hz", Numbers, "natural frequencies of the model at which the residuals stand out (Hz)"),
];

const MODE: &[Key] = &[
    must("frequency_hz", Number, "natural frequency (Hz)"),
    must("damping_ratio", Number, "damping ratio"),
    must("start_hz", Number, "natural frequency at the start of the fit (Hz)"),
];

const DECAY: &[Key] = &[
    must("record", Text, "the record"),
    must("from_s", Number, "beginning of the free motion (s since the first sample)"),
    must("to_s", Number, "its end"),
    must("resolution_hz", Number, "what a spectrum of that length resolves (Hz)"),
    must("noise_ratio", Number, "noise found over noise declared"),
    must("modes", Tables(DECAY_MODE), "modes by frequency"),
    must("unresolved", Pairs, "pairs of frequencies that the record cannot keep apart (Hz)"),
    must("unseen", Tables(UNSEEN), "modes of the identified model that were not measured"),
];

const DECAY_MODE: &[Key] = &[
    must("frequency_hz", Number, "undamped natural frequency (Hz)"),
    must("frequency_std_hz", Number, "its standard deviation (Hz)"),
    must("damping_ratio", Number, "damping ratio"),
    must("damping_std", Number, "its standard deviation"),
    key("model_hz", Number, "frequency of the mode of the model that it is (Hz)"),
    key("model_damping", Number, "damping ratio of that mode"),
    key("mac", Number, "modal assurance of the two"),
    key("note", Text, "what it is, when it is no mode of the model"),
];

const UNSEEN: &[Key] = &[must("frequency_hz", Number, "its frequency (Hz)"), must("why", Text, "why")];

const CLOCK: &[Key] = &[
    must("record", Text, "the record"),
    must("group", Text, "torque or gyro"),
    must("offset_s", Number, "how late the channels are at mid-record (s)"),
    must("offset_std_s", Number, "its standard deviation (s)"),
    must("skew_ppm", Number, "how fast their clock runs (ppm)"),
    must("skew_std_ppm", Number, "its standard deviation (ppm)"),
    must("corrected", Flag, "whether the record was corrected by it"),
];

const COMPARISON: &[Key] = &[
    must("recommended", Text, "the one to use"),
    must("reason", Text, "why"),
    must("explains", Flag, "whether it explains the data that were held out to their noise"),
    must("judged_by", Text, "what judged"),
    must("candidates", Tables(CANDIDATE), "all, best prediction first"),
];

const CANDIDATE: &[Key] = &[
    must("name", Text, "its name"),
    must("unknowns", Whole, "combinations of unknowns that were estimated"),
    must("aic", Number, "Akaike's criterion above that of the best"),
    must("bic", Number, "Schwarz's criterion above that of the best"),
    must("held_out", Number, "-2 ln L of the data held out above that of the best"),
    must("held_out_std", Number, "standard deviation of that difference"),
    must("held_out_mean_square", Number, "mean square of the residuals held out"),
];

const RECORD_FIT: &[Key] = &[
    must("label", Text, "its name: prefix of its biases and initial state"),
    must("samples", Whole, "samples"),
    must("rate_hz", Number, "rate (Hz)"),
    must("seconds", Number, "length (s)"),
    must("mean_square", Number, "mean square of its whitened residuals"),
    must("channels", Tables(CHANNEL), "every channel"),
];

const KEPT_RECORD: &[Key] = &[
    must("label", Text, "its name"),
    must("file", Text, "its file in the folder"),
    must("resampled_torques", Flag, "its torques were put on another clock by interpolation"),
    must("resampled_gyro", Flag, "its gyro was"),
    key("continues", Flag, "it is the part behind a gap"),
    key("ago", Whole, "identifications before that one it was fitted first"),
];

const CHANNEL: &[Key] = &[
    must("name", Text, "name, such as tau.joint1"),
    must("unit", Text, "SI unit"),
    must("signal_rms", Number, "root mean square of the measured signal"),
    must("residual_rms", Number, "root mean square of the residual"),
    must("over_noise", Number, "that over the standard deviation of the sensor"),
];

const HELD_OUT: &[Key] = &[
    must("source", Text, "the file, or the part of the record"),
    must("samples", Whole, "samples"),
    must("seconds", Number, "length (s)"),
    must("chi2_per_dof", Number, "as that of the fit, with the parameters as they are"),
    must("limit", Number, "largest value at which the model counts as explaining them"),
    must("explained", Flag, "whether it does: chi-squared is within the limit, and no test speaks against the model"),
    key("evidence", Table(EVIDENCE), "what the tests of a fit say of these data, with what was known before them"),
    must("channels", Tables(CHANNEL), "every channel"),
    must("verdict", Text, "in words"),
];

const WARNING: &[Key] = &[must("code", Text, "its code"), must("message", Text, "what it says")];

const PROVENANCE: &[Key] = &[
    must("program", Text, "program and version"),
    must("inputs", Tables(INPUT), "files, as they were named"),
    must("record", Table(RECORD), "the record, its first part when the rest was held out"),
    must("noise_torque_nm", Number, "standard deviation that whitened torques (N m)"),
    must("noise_gyro_rad_per_s", Number, "standard deviation that whitened the gyro (rad/s)"),
    must("settings", Words, "settings by name"),
];

const INPUT: &[Key] = &[
    must("file", Text, "path as given"),
    must("bytes", Whole, "size (bytes)"),
    must("sha256", Text, "SHA-256, hexadecimal"),
    key(
        "content",
        Text,
        "of a record: hashes of some of its samples, by which its readings are known in any other file",
    ),
];

const RECORD: &[Key] = &[
    must("samples", Whole, "samples used"),
    must("rate_hz", Number, "rate (Hz)"),
    must("seconds", Number, "length (s)"),
    must("t0", Number, "first time stamp (s)"),
    must("rates", Flag, "whether joint rates and accelerations were recorded and used"),
];
