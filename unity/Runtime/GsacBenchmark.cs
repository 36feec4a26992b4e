using System;
using System.Globalization;
using UnityEngine;

namespace Gsac
{
    /// <summary>
    /// The paper's protocol: three poses, switched every 0.5 s, frames counted each second, ten minutes. Writes median, 95th
    /// and 99th percentile of the frame time and the device's name to a file.
    /// </summary>
    [AddComponentMenu("Gsac/Gsac Benchmark")]
    public sealed class GsacBenchmark : MonoBehaviour
    {
        const int MostSeconds = 24 * 3600;

        [SerializeField] GsacAvatar avatar = null;
        [SerializeField, Tooltip("Where no avatar is named: the first of these.")] GsacCast cast = null;
        [SerializeField, Tooltip("s")] float duration = 600;
        [SerializeField, Tooltip("s between two poses")] float every = 0.5f;
        [SerializeField, Tooltip("s before counting begins")] float warmUp = 3;

        readonly GsacTimes times = new GsacTimes();
        int[] perSecond;
        int seconds;
        int framesOfSecond;
        double clock;
        double secondEnds;
        int pose = -1;

        /// <summary>Null until the end.</summary>
        public string ResultFile { get; private set; }

        void OnEnable()
        {
            QualitySettings.vSyncCount = 0;
            Application.targetFrameRate = -1;
            Application.runInBackground = true;
            perSecond = new int[Math.Min(MostSeconds, (int)duration + 2)];
            secondEnds = warmUp + 1;
        }

        void Start()
        {
            if (avatar == null && cast != null) avatar = cast.First;
        }

        void Update()
        {
            if (avatar == null || ResultFile != null) return;
            double frame = Time.unscaledDeltaTime;
            clock += frame;
            ShowPose((int)(clock / every) % 3);
            if (clock < warmUp) return;
            times.Add(frame);
            framesOfSecond++;
            if (clock >= secondEnds && seconds < perSecond.Length)
            {
                perSecond[seconds++] = framesOfSecond;
                framesOfSecond = 0;
                secondEnds += 1;
            }
            if (clock >= warmUp + duration) Finish();
        }

        void ShowPose(int which)
        {
            if (which == pose) return;
            pose = which;
            if (which == 0) avatar.TPose();
            else if (which == 1 || avatar.Data.Clips.Count == 0) avatar.APose();
            else
            {
                foreach (string clip in avatar.Data.Clips.Keys)
                {
                    avatar.ShowMoment(clip, 0.8f);
                    break;
                }
            }
            avatar.SkipFade();
        }

        void Finish()
        {
            GsacReport report = GsacReport.OfDevice("benchmark");
            report.Add("width", Screen.width);
            report.Add("height", Screen.height);
            report.Add("gaussians", avatar.Data.Levels[0].Count);
            report.Add("pose_every_s", every);
            report.Add("seconds", times.Sum);
            report.Add("frames", times.Count);
            report.Add("mean_fps", times.Count / Math.Max(times.Sum, 1e-9));
            report.Add("median_ms", 1000 * times.Quantile(0.5));
            report.Add("p95_ms", 1000 * times.Quantile(0.95));
            report.Add("p99_ms", 1000 * times.Quantile(0.99));
            report.Add("fps_each_second", perSecond, seconds);
            ResultFile = report.Write("gsac-benchmark");
        }

        void OnGUI()
        {
            string state = ResultFile != null ? "written to " + ResultFile
                : clock.ToString("F0", CultureInfo.InvariantCulture) + " of " + (warmUp + duration).ToString(CultureInfo.InvariantCulture) + " s";
            string rate = seconds > 0 ? perSecond[seconds - 1] + " frames in the last second; " : "";
            GUILayout.Label("Gsac benchmark: " + rate + state);
        }
    }
}
