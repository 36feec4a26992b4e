using System;
using System.Collections.Generic;
using System.Globalization;
using System.IO;
using System.Text;
using UnityEngine;

namespace Gsac
{
    /// <summary>What was measured on a device, as a JSON file in the application's data folder.</summary>
    public sealed class GsacReport
    {
        readonly StringBuilder text = new StringBuilder();

        /// <summary>The device comes first; name: of what was measured, such as `benchmark`.</summary>
        public static GsacReport OfDevice(string name)
        {
            var report = new GsacReport();
            report.Add("report", "gsac-" + name);
            report.Add("device", SystemInfo.deviceModel);
            report.Add("gpu", SystemInfo.graphicsDeviceName);
            report.Add("api", SystemInfo.graphicsDeviceType.ToString());
            report.Add("processor", SystemInfo.processorType);
            report.Add("system", SystemInfo.operatingSystem);
            report.Add("unity", Application.unityVersion);
            report.Add("editor", Application.isEditor);
            return report;
        }

        /// <summary>value: text, a number, or yes and no.</summary>
        public void Add(string name, object value)
        {
            if (value is string) Put(name, '"' + ((string)value).Replace("\\", "\\\\").Replace("\"", "\\\"") + '"');
            else if (value is bool) Put(name, (bool)value ? "true" : "false");
            else Put(name, Convert.ToString(value, CultureInfo.InvariantCulture));
        }

        /// <summary>Numbers in a row.</summary>
        public void Add(string name, int[] numbers, int count)
        {
            var row = new StringBuilder();
            for (int i = 0; i < count; i++) row.Append(i == 0 ? "" : ", ").Append(numbers[i]);
            Put(name, "[" + row + "]");
        }

        public void Add(string name, List<GsacReport> rows)
        {
            Put(name, "[" + string.Join(", ", rows.ConvertAll(row => row.ToString())) + "]");
        }

        void Put(string name, string value)
        {
            text.Append(text.Length == 0 ? "" : ", ").Append('"').Append(name).Append("\": ").Append(value);
        }

        public override string ToString()
        {
            return "{" + text + "}";
        }

        /// <summary>Writes it beside those of other times; name: the file's, before the time.</summary>
        public string Write(string name)
        {
            string stamp = DateTime.Now.ToString("yyyyMMdd-HHmmss", CultureInfo.InvariantCulture);
            string path = Path.Combine(Application.persistentDataPath, name + "-" + stamp + ".json");
            File.WriteAllText(path, this + "\n");
            Debug.Log("Gsac: written to " + path);
            return path;
        }
    }
}
