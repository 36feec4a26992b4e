using System;
using System.Globalization;
using System.IO;
using System.Text;
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
            string stamp = DateTime.Now.ToString("yyyyMMdd-HHmmss", CultureInfo.InvariantCulture);
            ResultFile = Path.Combine(Application.persistentDataPath, "gsac-benchmark-" + stamp + ".json");
            File.WriteAllText(ResultFile, Report());
            Debug.Log("Gsac benchmark: written to " + ResultFile);
        }

        string Report()
        {
            var text = new StringBuilder("{\n");
            Line(text, "device", SystemInfo.deviceModel);
            Line(text, "gpu", SystemInfo.graphicsDeviceName);
            Line(text, "api", SystemInfo.graphicsDeviceType.ToString());
            Line(text, "processor", SystemInfo.processorType);
            Line(text, "system", SystemInfo.operatingSystem);
            Line(text, "unity", Application.unityVersion);
            Line(text, "editor", Application.isEditor);
            Line(text, "width", Screen.width);
            Line(text, "height", Screen.height);
            Line(text, "gaussians", avatar.Data.Levels[0].Count);
            Line(text, "pose_every_s", every);
            Line(text, "seconds", times.Sum);
            Line(text, "frames", times.Count);
            Line(text, "mean_fps", times.Count / Math.Max(times.Sum, 1e-9));
            Line(text, "median_ms", 1000 * times.Quantile(0.5));
            Line(text, "p95_ms", 1000 * times.Quantile(0.95));
            Line(text, "p99_ms", 1000 * times.Quantile(0.99));
            text.Append("  \"fps_each_second\": [");
            for (int i = 0; i < seconds; i++) text.Append(i == 0 ? "" : ", ").Append(perSecond[i]);
            return text.Append("]\n}\n").ToString();
        }

        static void Line(StringBuilder text, string name, object value)
        {
            text.Append("  \"").Append(name).Append("\": ");
            if (value is string) text.Append('"').Append(((string)value).Replace("\\", "\\\\").Replace("\"", "\\\"")).Append('"');
            else if (value is bool) text.Append((bool)value ? "true" : "false");
            else text.Append(Convert.ToString(value, CultureInfo.InvariantCulture));
            text.Append(",\n");
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
