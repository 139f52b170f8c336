// verdict.js -- how far the re-render of held-out photographs is off, in words: by the figure, and by how much of it is noise
// of the re-render itself. The words and their limits are those of the report (server/export/report_verdict.c).

const WORDS = [[30, "hard to tell from the photograph"], [25, "agrees but for details"], [20, "differs visibly"], [-Infinity, "far from the photograph"]];
const DISTURBS = 0.2;   // share of the squared relative error that the noise leaves uncertain
const DOMINATES = 0.5;  // share of it that is noise, in reports whose figures still have the noise in them

// metrics: of report.json. [words, explanation]; [] where no photograph was held out
export function verdictOf({ psnr_db, msre, msre_noise_left, msre_render_noise }) {
  if (!Number.isFinite(psnr_db)) return [];
  const figure = `${psnr_db.toFixed(1)} dB`, about = "PSNR of photographs that the reconstruction never saw; 25 dB and more is good";
  const word = WORDS.find(([least]) => psnr_db >= least)[1];
  if (msre_noise_left === undefined && msre_render_noise > DOMINATES * msre)
    return [`${figure}, mostly noise of the re-render`, `${about}. The re-render has too few samples to tell more: report_samples`];
  if (msre_noise_left > DISTURBS * msre)
    return [`${figure}, ${word}, as far as noise lets tell`, `${about}. The noise of the re-render leaves the error uncertain: report_samples`];
  return [`${figure}, ${word}`, about];
}
